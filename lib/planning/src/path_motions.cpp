// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_motions.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

namespace cairn {

std::vector<Pose2> motions_along(const Pose2& from, const PlannedPath& path,
                                 const RobotModel& robot) {
  std::vector<Pose2> motions;
  std::size_t passed = 0;
  Pose2 at = from;
  // Each of them turns or drives, so that there is a last one; the bound is for a robot that does
  // neither.
  const double least = std::max(0.01 * robot.step, 1e-3);
  const std::size_t most =
      static_cast<std::size_t>(path.length / least) + 1000 * (path.points.size() + 1);
  while (motions.size() < most) {
    const std::optional<Pose2> motion = next_motion(at, path, robot, passed);
    if (!motion) break;
    motions.push_back(*motion);
    at = at * *motion;
  }
  return motions;
}

}  // namespace cairn
