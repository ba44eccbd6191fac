// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/scan_clearance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "arc_length.hpp"
#include "cairn/exploration/dubins_curve.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

/// Between two places of the body that are compared with the scan [m].
constexpr double kStride = 0.01;
/// An edge may lie between two beams, nearer than either by their distance, or by this at most [m].
constexpr double kBetweenBeams = 0.01;
constexpr double kSigmas = 2.0, kLeastPart = 0.5;
/// Motions to a side: so many, so far apart [rad].
constexpr int kTurns = 10;
constexpr double kTurn = std::numbers::pi / 60.0;

/// Where the body is along a motion, from its start on.
std::vector<Vector2d> places_along(const Pose2& motion, MotionModel model) {
  const double chord = motion.translation().norm(), turn = motion.theta();
  const auto strides = static_cast<int>(std::ceil(chord / kStride));
  std::vector<Vector2d> places;
  for (int k = 0; k <= strides; ++k) {
    const double part = double(k) / std::max(1, strides);
    const bool is_arc = model == MotionModel::dubins && std::abs(turn) > 1e-9;
    const double length = arc_length(motion);
    places.push_back(is_arc ? along_arc(turn / length, part * length).translation()
                            : part * motion.translation());
  }
  return places;
}

}  // namespace

std::vector<Vector2d> beam_ends(const LaserScan& scan) {
  std::vector<Vector2d> ends;
  for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
    const double range = scan.ranges[beam], angle = scan.angle(beam);
    if (range > 0.0 && range < scan.max_range)
      ends.push_back(range * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return ends;
}

std::vector<Vector2d> touched_points(std::span<const Vector2d> points, const Pose2& motion,
                                     const RobotModel& robot) {
  const double noise = kSigmas * robot.lidar.sigma;
  const double reach = motion.translation().norm() + robot.radius + kBetweenBeams;
  const std::vector<Vector2d> places = places_along(motion, robot.motion);
  std::vector<Vector2d> touched;
  for (const Vector2d& point : points) {
    const double range = point.norm();
    if (range > reach) continue;
    const double between = std::min(range * robot.lidar.step(), kBetweenBeams);
    const double near = std::max(kLeastPart * robot.radius, robot.radius + between - noise);
    double before = range;
    const bool is_touched = std::ranges::any_of(places, [&](const Vector2d& place) {
      const double apart = (point - place).norm();
      const bool nearer = apart < near && apart < before;
      before = apart;
      return nearer;
    });
    if (is_touched) touched.push_back(point);
  }
  return touched;
}

std::optional<Pose2> motion_beside(std::span<const Vector2d> points, const Pose2& motion,
                                   const RobotModel& robot) {
  if (robot.motion == MotionModel::dubins) return std::nullopt;
  for (const double part : {1.0, 0.5}) {
    for (int k = 1; k <= kTurns; ++k) {
      for (const double side : {1.0, -1.0}) {
        const double turn = side * k * kTurn;
        if (robot.motion == MotionModel::differential &&
            std::abs(motion.theta() + turn) > robot.turn)
          continue;  // it drives where it looks
        const Vector2d way = part * (Pose2(0.0, 0.0, turn) * motion.translation());
        const Pose2 beside(way.x(), way.y(),
                           std::clamp(motion.theta() + turn, -robot.turn, robot.turn));
        if (touched_points(points, beside, robot).empty()) return beside;
      }
    }
  }
  return std::nullopt;
}

}  // namespace cairn
