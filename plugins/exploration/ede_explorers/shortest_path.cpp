// SPDX-License-Identifier: BSD-3-Clause
#include "shortest_path.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cairn/planning/potential_field.hpp"

namespace cairn::exploration {

using Eigen::Vector2d;

PlannedPath path_along(const Situation& situation, const ConfigurationSpace& space,
                       std::span<const Pose2> poses) {
  PlannedPath path;
  path.points = straightened(space, poses);
  if (path.points.front() != situation.pose.translation())
    path.points.insert(path.points.begin(), situation.pose.translation());
  for (std::size_t k = 1; k < path.points.size(); ++k)
    path.length += (path.points[k] - path.points[k - 1]).norm();
  const double heading = poses.back().theta();
  path.look_at = path.points.back() + Vector2d(std::cos(heading), std::sin(heading));
  return path;
}

PlannedPath shortest_path(const Situation& situation, const ReachableField& at,
                          std::size_t configuration) {
  const ConfigurationSpace& space = at.field->space();
  const auto length = [&](std::int32_t number) {
    return at.lengths[static_cast<std::size_t>(number)];
  };
  std::vector<Pose2> poses{space.pose(configuration)};
  // Back to where lengths are least, each time to the neighbour from which this one was reached.
  for (std::int32_t here = space.number_of(configuration); here >= 0;) {
    const std::int32_t cell = space.cells()[static_cast<std::size_t>(here)];
    const int x = cell % space.frame().width, y = cell / space.frame().width;
    std::int32_t before = -1;
    double least = 0.0;
    for (int side = 0; side < 9; ++side) {
      const int dx = side % 3 - 1, dy = side / 3 - 1;
      const std::int32_t other = space.number(x + dx, y + dy);
      if (other < 0 || !(length(other) < length(here))) continue;
      const double whole = length(other) + std::hypot(dx, dy) * space.frame().resolution;
      if (before >= 0 && !(whole < least)) continue;
      before = other;
      least = whole;
    }
    if (before >= 0) {
      const Vector2d point = space.position(before);
      poses.emplace_back(point.x(), point.y(), 0.0);
    }
    here = before;
  }
  if (space.nearest(situation.pose)) poses.back() = situation.pose;
  std::ranges::reverse(poses);
  if (poses.size() == 1) poses.push_back(space.pose(configuration));
  return path_along(situation, space, poses);
}

std::optional<std::size_t> best_beyond(const ReachableField& at, double length) {
  std::vector<char> far(at.reachable.size());
  for (std::size_t k = 0; k < far.size(); ++k)
    far[k] = static_cast<char>(at.reachable[k] != 0 && at.lengths[k] >= length);
  return at.field->best(far);
}

}  // namespace cairn::exploration
