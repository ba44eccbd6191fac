// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/path_planner.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

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

/// A part of a path in one direction, as one that is driven ahead.
using Leg = std::span<const Eigen::Vector2d>;

/// Passes the points that are reached, and those that lie behind the robot and near it. Returns how
/// many are left.
std::size_t pass_points(const Pose2& at, const RobotModel& robot, bool ends_in_cusp, Leg leg) {
  const double there = there_of(robot);
  // A motion of millimetres would only cost a scan.
  constexpr double kAtCusp = 0.02, kRounding = 1e-9;  // [m]
  for (; !leg.empty(); leg = leg.subspan(1)) {
    const Eigen::Vector2d& point = leg.front();
    const double apart = (point - at.translation()).norm();
    const bool is_last = leg.size() == 1;
    const double ahead =
        is_last ? at.transform_to(point).x() : (point - at.translation()).dot(leg[1] - point);
    // The last one has to be reached as well as can be: nothing leads nearer once it is behind.
    const double reached = is_last && ends_in_cusp ? kAtCusp : kRounding;
    const bool is_passed = ahead <= reached && apart < robot.step;
    if (!is_passed && (is_last || apart >= there)) break;
  }
  return leg.size();
}

/// The point of a leg so far ahead [m], or its end.
Eigen::Vector2d point_ahead(const Pose2& at, Leg leg, double distance) {
  Eigen::Vector2d from = at.translation();
  for (const Eigen::Vector2d& point : leg) {
    const double part = (point - from).norm();
    if (part >= distance) return from + distance / part * (point - from);
    distance -= part;
    from = point;
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
double strayed(const Pose2& at, const Arc& arc, Leg leg) {
  double most = 0.0;
  for (const double part : {0.25, 0.5, 0.75}) {
    const double driven = part * arc.length;
    const Eigen::Vector2d point = (at * along_arc(arc.curvature, driven)).translation();
    most = std::max(most, (point - point_ahead(at, leg, driven)).norm());
  }
  return most;
}

/// Ahead along a leg, of which points are left.
Pose2 motion_along(const Pose2& at, Leg leg, const RobotModel& robot) {
  // A point far ahead makes long motions, a near one cuts no corners.
  constexpr double kStray = 0.02;  // [m]
  constexpr int kHalvings = 3;
  Arc arc;
  double ahead = robot.step;
  for (int k = 0; k <= kHalvings; ++k, ahead *= 0.5) {
    arc = arc_to(at, point_ahead(at, leg, ahead), robot.turning_radius);
    if (strayed(at, arc, leg) < kStray) break;
  }
  double length = std::min(arc.length, robot.step);
  if (std::abs(arc.curvature) * length > robot.turn) length = robot.turn / std::abs(arc.curvature);
  return along_arc(arc.curvature, length);
}

/// A robot that backs is one that drives ahead with the opposite heading.
std::optional<Pose2> arc_motion(const Pose2& at, const PlannedPath& path, const RobotModel& robot,
                                std::size_t& passed) {
  const Pose2 about(0.0, 0.0, std::numbers::pi);
  while (passed < path.points.size()) {
    const auto cusp = std::ranges::lower_bound(path.cusps, passed);
    const bool backs = (cusp - path.cusps.begin()) % 2 == 1;
    const bool ends_in_cusp = cusp != path.cusps.end();
    const std::size_t end = ends_in_cusp ? *cusp + 1 : path.points.size();
    const Leg leg(path.points.data() + passed, end - passed);
    const Pose2 heading = backs ? at * about : at;
    const std::size_t left = pass_points(heading, robot, ends_in_cusp, leg);
    passed = end - left;
    if (left == 0) continue;
    const Pose2 motion = motion_along(heading, leg.last(left), robot);
    return backs ? Pose2(-motion.x(), -motion.y(), motion.theta()) : motion;
  }
  return std::nullopt;
}

}  // namespace

PathPlanner::~PathPlanner() = default;

std::optional<Pose2> next_motion(const Pose2& at, const PlannedPath& path, const RobotModel& robot,
                                 std::size_t& passed) {
  return robot.motion == MotionModel::dubins ? arc_motion(at, path, robot, passed)
                                             : turning_motion(at, path, robot, passed);
}

}  // namespace cairn
