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
      .real("line_radius", &O::radius, 0.01, 10.0,
            "radius of the neighbourhood that a line is fitted to [m]")
      .integer("line_neighbours", &O::neighbours, 2, 100,
               "points on each side that it has at least")
      .real("roughness", &O::roughness, 1e-3, 1.0,
            "largest standard deviation of points from their line [m]");
}

OptionFields<CorrelationOptions> correlation_fields() {
  using O = CorrelationOptions;
  return OptionFields<O>()
      .real("search_step", &O::cell, 0.05, 1.0, "of positions in the correlative search [m]")
      .real("search_angle_step", &O::angle_step, 0.005, 1.0, "and of orientations [rad]")
      .real("search_blur", &O::blur, 0.01, 1.0,
            "standard deviation of the likelihood about a surface [m]")
      .real("search_least", &O::least_score, 0.0, 1.0,
            "least likelihood of a candidate of the search, as a part of the best one's")
      .integer("search_candidates", &O::candidates, 1, 100,
               "most candidates of the search that are refined and compared");
}

OptionFields<PointToLineOptions> refinement_fields() {
  using O = PointToLineOptions;
  return OptionFields<O>()
      .real("distance", &O::distance, 0.01, 10.0,
            "largest distance from a point to its line in the first iteration, without a search "
            "[m]")
      .real("last_distance", &O::last_distance, 0.01, 10.0, "and in the last iterations [m]")
      .real("shrink", &O::shrink, 0.1, 0.99, "factor on that distance per iteration")
      .real("trim", &O::trim, 0.3, 1.0,
            "fraction of the matched points that is used, those with the least residuals")
      .real("normal", &O::normal, 0.05, 1.6,
            "largest angle between the surface at a point and its line [rad]")
      .integer("iterations", &O::iterations, 1, 1000, "most iterations");
}

OptionFields<CovarianceOptions> covariance_fields() {
  using O = CovarianceOptions;
  return OptionFields<O>()
      .real("unobserved", &O::unobserved, 1e-2, 100.0,
            "standard deviation of a direction that the scans do not determine [m]")
      .real("observed", &O::observed, 1.0, 1e3,
            "least information of a direction that they determine, in that of the noise of normals")
      .real("observed_sigma", &O::most, 1e-3, 10.0, "and its largest standard deviation [m]")
      .real("inflation", &O::inflation, 0.1, 100.0,
            "factor on standard deviations, for errors that neighbouring points share")
      .real("tilt", &O::tilt, 0.0, 1.0,
            "standard deviation of an undetermined direction's own direction [rad]")
      .real("least_sigma", &O::floor, 1e-6, 1.0, "least standard deviation in any direction [m]");
}

OptionFields<AcceptanceOptions> acceptance_fields() {
  using O = AcceptanceOptions;
  return OptionFields<O>()
      .integer("least_matches", &O::least_matches, 6, 100000, "least number of matched points")
      .real("least_overlap", &O::least_overlap, 0.0, 1.0,
            "least fraction of the points within each other's view that agree")
      .real("most_conflict", &O::most_conflict, 0.0, 1.0,
            "largest fraction of the points not hidden that the other lidar looked through")
      .real("largest_rms", &O::largest_rms, 1e-3, 10.0,
            "largest root mean square of the residuals [m]")
      .real("margin", &O::margin, 0.0, 1.0,
            "by which the quality must exceed that of any other pose, or the match is ambiguous")
      .real("tolerance", &O::tolerance, 1e-3, 10.0,
            "of ranges, where points are compared with what the other lidar saw [m]");
}

}  // namespace

OptionFields<ScanMatcherOptions> ScanMatcherOptions::fields() {
  using O = ScanMatcherOptions;
  return OptionFields<O>()
      .part(&O::window, window_fields())
      .real("poor_distance", &O::poor_distance, 0.0, 100.0,
            "an expected position that may be further off is searched for first [m] (three "
            "standard deviations)")
      .real("poor_angle", &O::poor_angle, 0.0, 3.15, "likewise an expected orientation [rad]")
      .part(&O::surface, surface_fields())
      .part(&O::correlation, correlation_fields())
      .part(&O::refinement, refinement_fields())
      .part(&O::covariance, covariance_fields())
      .part(&O::acceptance, acceptance_fields());
}

}  // namespace cairn::icp
