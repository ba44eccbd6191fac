// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_motions.hpp"

#include <cstddef>
#include <optional>

namespace cairn {
namespace {

/// Steering that does not come to the end of a path goes in circles around it: then the motions are
/// longer than the path by more than this factor, and these metres.
constexpr double kDetour = 1.5, kSpare = 0.5;

/// None: they lead nowhere.
std::optional<std::vector<Pose2>> motions_of(const Pose2& from, const PlannedPath& path,
                                             const RobotModel& robot) {
  const double most = kDetour * path.length + kSpare;
  // Each turns or drives, so that there is a last one; the bound is for a robot that does neither.
  const std::size_t most_motions =
      static_cast<std::size_t>(path.length / 1e-3) + 1000 * (path.points.size() + 1);
  std::vector<Pose2> motions;
  std::size_t passed = 0;
  double driven = 0.0;
  Pose2 at = from;
  while (const std::optional<Pose2> motion = next_motion(at, path, robot, passed)) {
    motions.push_back(*motion);
    driven += motion->translation().norm();
    if (motions.size() > most_motions || (robot.motion == MotionModel::dubins && driven > most))
      return std::nullopt;
    at = at * *motion;
  }
  return motions;
}

}  // namespace

std::vector<Pose2> motions_along(const Pose2& from, const PlannedPath& path,
                                 const RobotModel& robot) {
  if (auto motions = motions_of(from, path, robot)) return *std::move(motions);
  RobotModel turning = robot;
  turning.motion = MotionModel::differential;
  return motions_of(from, path, turning).value_or(std::vector<Pose2>());
}

}  // namespace cairn
