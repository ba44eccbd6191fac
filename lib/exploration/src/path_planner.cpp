// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/path_planner.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/exploration/dubins_curve.hpp"

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

double there_of(const RobotModel& robot) { return std::min(kThere, kTherePart * robot.step); }

/// Turns in place, or drives.
std::optional<Pose2> turning_motion(const Pose2& at, const PlannedPath& path,
                                    const RobotModel& robot, std::size_t& passed) {
  const double there = there_of(robot);
  const auto apart = [&] { return (path.points[passed] - at.translation()).norm(); };
  while (passed < path.points.size() && apart() < there) ++passed;
  if (passed < path.points.size()) {
    const double angle = bearing(at, path.points[passed]);
    const bool is_free = robot.motion == MotionModel::holonomic;
    if (!is_free && std::abs(angle) > robot.turn) return turn_by(angle, robot.turn);
    const double length = std::min(apart(), robot.step);
    return Pose2(length * std::cos(angle), length * std::sin(angle),
                 std::clamp(angle, -robot.turn, robot.turn));
  }
  if (!path.look_at || (*path.look_at - at.translation()).norm() < there) return std::nullopt;
  const double angle = bearing(at, *path.look_at);
  if (std::abs(angle) < kFacing) return std::nullopt;
  return turn_by(angle, robot.turn);
}

// Along arcs --------------------------------------------------------------------------------------

/// Passes the points that are reached, and those that lie behind the robot and near it.
void pass_points(const Pose2& at, const PlannedPath& path, const RobotModel& robot,
                 std::size_t& passed) {
  const double there = there_of(robot);
  for (; passed < path.points.size(); ++passed) {
    const Eigen::Vector2d& point = path.points[passed];
    const double apart = (point - at.translation()).norm();
    const bool is_last = passed + 1 == path.points.size();
    const double ahead = is_last ? at.transform_to(point).x()
                                 : (point - at.translation()).dot(path.points[passed + 1] - point);
    // The last one has to be reached as well as can be: nothing leads nearer once it is behind.
    const bool is_passed = ahead <= 0.0 && apart < robot.step;
    if (!is_passed && (is_last || apart >= there)) return;
  }
}

/// The point of a path so far ahead [m], or its end.
Eigen::Vector2d point_ahead(const Pose2& at, const PlannedPath& path, std::size_t passed,
                            double distance) {
  Eigen::Vector2d from = at.translation();
  for (std::size_t k = passed; k < path.points.size(); ++k) {
    const double part = (path.points[k] - from).norm();
    if (part >= distance) return from + distance / part * (path.points[k] - from);
    distance -= part;
    from = path.points[k];
  }
  return from;
}

/// An arc that begins along the robot's heading.
struct Arc {
  double curvature = 0.0, length = 0.0;  // [1/m], [m]
};

/// The one through a point, or as near to it as the turning radius allows.
Arc arc_to(const Pose2& at, const Eigen::Vector2d& point, double turning_radius) {
  const Eigen::Vector2d seen = at.transform_to(point);
  const double distance = seen.norm();
  const double turn = 2.0 * std::atan2(seen.y(), seen.x());
  const double curvature = 2.0 * seen.y() / (distance * distance);
  const double most = 1.0 / turning_radius;
  if (std::abs(curvature) <= most && std::abs(turn) <= std::numbers::pi) {
    constexpr double kStraight = 1e-9;  // [rad]
    return {curvature, std::abs(turn) < kStraight ? distance : turn / curvature};
  }
  return {seen.y() < 0.0 ? -most : most, distance};
}

/// The farthest from the path that an arc comes between its ends [m], about.
double strayed(const Pose2& at, const Arc& arc, const PlannedPath& path, std::size_t passed) {
  double most = 0.0;
  for (const double part : {0.25, 0.5, 0.75}) {
    const double driven = part * arc.length;
    const Eigen::Vector2d point = (at * along_arc(arc.curvature, driven)).translation();
    most = std::max(most, (point - point_ahead(at, path, passed, driven)).norm());
  }
  return most;
}

std::optional<Pose2> arc_motion(const Pose2& at, const PlannedPath& path, const RobotModel& robot,
                                std::size_t& passed) {
  pass_points(at, path, robot, passed);
  if (passed == path.points.size()) return std::nullopt;
  // A point far ahead makes long motions, a near one cuts no corners.
  constexpr double kStray = 0.02;  // [m]
  constexpr int kHalvings = 3;
  Arc arc;
  double ahead = robot.step;
  for (int k = 0; k <= kHalvings; ++k, ahead *= 0.5) {
    arc = arc_to(at, point_ahead(at, path, passed, ahead), robot.turning_radius);
    if (strayed(at, arc, path, passed) < kStray) break;
  }
  double length = std::min(arc.length, robot.step);
  if (std::abs(arc.curvature) * length > robot.turn) length = robot.turn / std::abs(arc.curvature);
  return along_arc(arc.curvature, length);
}

}  // namespace

PathPlanner::~PathPlanner() = default;

std::optional<Pose2> next_motion(const Pose2& at, const PlannedPath& path, const RobotModel& robot,
                                 std::size_t& passed) {
  return robot.motion == MotionModel::dubins ? arc_motion(at, path, robot, passed)
                                             : turning_motion(at, path, robot, passed);
}

}  // namespace cairn
