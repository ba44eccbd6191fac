// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/path_planner.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

/// Nearer than this to a point, the robot is there [m]; and nearer than this part of a step: after
/// a step with noise it would turn back for what it has missed.
constexpr double kThere = 0.1;
constexpr double kTherePart = 0.2;
/// Nearer than this to a direction, it looks there [rad].
constexpr double kFacing = 0.02;

double bearing(const Pose2& at, const Eigen::Vector2d& point) {
  const Eigen::Vector2d seen = at.transform_to(point);
  return std::atan2(seen.y(), seen.x());
}

Pose2 turn_by(double angle, double most) { return {0.0, 0.0, std::clamp(angle, -most, most)}; }

}  // namespace

PathPlanner::~PathPlanner() = default;

std::optional<Pose2> next_motion(const Pose2& at, const PlannedPath& path, const RobotModel& robot,
                                 std::size_t& passed) {
  const double there = std::min(kThere, kTherePart * robot.step);
  const auto apart = [&] { return (path.points[passed] - at.translation()).norm(); };
  while (passed < path.points.size() && apart() < there) ++passed;
  if (passed < path.points.size()) {
    const double angle = bearing(at, path.points[passed]);
    if (std::abs(angle) > robot.turn) return turn_by(angle, robot.turn);
    const double length = std::min(apart(), robot.step);
    return Pose2(length * std::cos(angle), length * std::sin(angle), angle);
  }
  if (!path.look_at || (*path.look_at - at.translation()).norm() < there) return std::nullopt;
  const double angle = bearing(at, *path.look_at);
  if (std::abs(angle) < kFacing) return std::nullopt;
  return turn_by(angle, robot.turn);
}

}  // namespace cairn
