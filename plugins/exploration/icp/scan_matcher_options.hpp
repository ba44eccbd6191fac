// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/option_fields.hpp"
#include "correlation.hpp"
#include "match_covariance.hpp"
#include "point_to_line.hpp"
#include "surface_scan.hpp"

namespace cairn::icp {

/// What a match must be to be accepted.
struct AcceptanceOptions {
  int least_matches = 20;        ///< points on lines
  double least_overlap = 0.6;    ///< part of the points in each other's view that agree
  double most_conflict = 0.055;  ///< part of the points not hidden that are in front of surfaces
  double largest_rms = 0.06;     ///< of the residuals after trimming [m]
  double margin = 0.06;          ///< by which the quality exceeds that of any other pose
  double tolerance = 0.1;        ///< of ranges where points are compared with the other scan [m]
};

/// Options of the registration `icp` and of `ScanMatcher`.
struct ScanMatcherOptions {
  SurfaceOptions surface;
  SearchWindow window;  ///< of the search if nothing is expected
  CorrelationOptions correlation;
  PointToLineOptions refinement;
  CovarianceOptions covariance;
  AcceptanceOptions acceptance;
  /// A guess is poor, so that the window is searched first, beyond these errors (three standard
  /// deviations of what is expected).
  double poor_distance = 0.3;  ///< [m]
  double poor_angle = 0.1745;  ///< [rad]

  static OptionFields<ScanMatcherOptions> fields();
};

}  // namespace cairn::icp
