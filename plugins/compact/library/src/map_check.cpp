// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/map_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <fmt/core.h>

#include "cairn/runtime/result_fields.hpp"

namespace cairn {

double extent_of(const Trajectory& poses) {
  double squares = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] =
        std::ranges::minmax(poses, {}, [axis](const TrajectoryPose& pose) { return pose.t[axis]; });
    squares += (high.t[axis] - low.t[axis]) * (high.t[axis] - low.t[axis]);
  }
  return std::sqrt(squares);
}

std::string MapCheck::to_string() const {
  return fmt::format("{:.3g} m from the map of all measurements, {:.2g} % of its extent", distance,
                     extent > 0.0 ? 100.0 * distance / extent : 0.0);
}

std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                  const PolicySetting& setting) {
  if (!matches_as_recorded(job) || result.interrupted || result.map_poses > 0) return std::nullopt;
  if (result.poses.size() < 2) return std::nullopt;
  const EstimateOfAll all = estimate_of_all(setting);
  if (!all.why_not.empty()) return std::nullopt;
  const Trajectory everything = trajectory(all.graph);
  return MapCheck{absolute_error(trajectory(result.trajectory), everything), extent_of(everything)};
}

ResultFields<MapCheck> MapCheck::fields() {
  using C = MapCheck;
  return ResultFields<C>()
      .figure("distance", &C::distance, "m",
              "how far the poses are from the map of all measurements, after alignment, root mean "
              "square; missing where that map is no measure: another map was continued, matches "
              "were inconsistent, or they were not those of the graph")
      .figure("extent", &C::extent, "m", "diagonal of the box around the map of all measurements")
      .details();
}

}  // namespace cairn
