// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/option_fields.hpp"
#include "correlation.hpp"
#include "match_covariance.hpp"
#include "surface_scan.hpp"

namespace cairn::icp {

/// What a match must be to be accepted.
struct AcceptanceOptions {
  double most_conflict = 0.055;  ///< part of the points not hidden that are in front of surfaces
  double largest_rms = 0.06;     ///< of the residuals after trimming [m]
  double tolerance = 0.1;        ///< of ranges where points are compared with the other scan [m]
};

/// Options of the registration `icp` and of `ScanMatcher`.
struct ScanMatcherOptions {
  SurfaceOptions surface;
  SearchWindow window;         ///< of the search if nothing is expected
  double last_distance = 0.1;  ///< from a point to its line in the last iterations [m]
  CovarianceOptions covariance;
  AcceptanceOptions acceptance;

  static OptionFields<ScanMatcherOptions> fields();
};

}  // namespace cairn::icp
