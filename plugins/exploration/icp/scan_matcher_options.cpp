// SPDX-License-Identifier: BSD-3-Clause
#include "scan_matcher_options.hpp"

namespace cairn::icp {
namespace {

OptionFields<SearchWindow> window_fields() {
  using O = SearchWindow;
  return OptionFields<O>()
      .real("range_x", &O::x, 0.0, 5.0,
            "searched around the expected position along x of the earlier pose, to either side "
            "[m]; around identity if nothing is expected")
      .real("range_y", &O::y, 0.0, 5.0, "along y [m]")
      .real("angle", &O::angle, 0.0, 3.15, "and around the expected orientation [rad]");
}

OptionFields<SurfaceOptions> surface_fields() {
  using O = SurfaceOptions;
  return OptionFields<O>()
      .real("sigma", &O::sigma, 1e-4, 1.0,
            "least standard deviation of ranges [m]; a larger one is estimated from the scans")
      .real("roughness", &O::roughness, 1e-3, 1.0,
            "largest standard deviation of points from their line [m]");
}

OptionFields<CovarianceOptions> covariance_fields() {
  using O = CovarianceOptions;
  return OptionFields<O>()
      .real("unobserved", &O::unobserved, 1e-2, 100.0,
            "standard deviation of a direction that the scans do not determine [m]")
      .real("tilt", &O::tilt, 0.0, 1.0,
            "standard deviation of an undetermined direction's own direction [rad]");
}

OptionFields<AcceptanceOptions> acceptance_fields() {
  using O = AcceptanceOptions;
  return OptionFields<O>()
      .real("most_conflict", &O::most_conflict, 0.0, 1.0,
            "largest fraction of the points not hidden that the other lidar looked through")
      .real("largest_rms", &O::largest_rms, 1e-3, 10.0,
            "largest root mean square of the residuals [m]")
      .real("tolerance", &O::tolerance, 1e-3, 10.0,
            "of ranges, where points are compared with what the other lidar saw [m]");
}

}  // namespace

OptionFields<ScanMatcherOptions> ScanMatcherOptions::fields() {
  using O = ScanMatcherOptions;
  return OptionFields<O>()
      .part(&O::window, window_fields())
      .part(&O::surface, surface_fields())
      .real("last_distance", &O::last_distance, 0.01, 10.0,
            "largest distance from a point to its line in the last iterations [m]")
      .part(&O::covariance, covariance_fields())
      .part(&O::acceptance, acceptance_fields());
}

}  // namespace cairn::icp
