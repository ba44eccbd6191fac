// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/scan_clearance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/dubins_curve.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using std::numbers::pi;

constexpr double kBetweenBeams = 0.01;

RobotModel robot_of(double sigma = 0.0, MotionModel motion = MotionModel::differential) {
  RobotModel robot;
  robot.motion = motion;
  robot.lidar.sigma = sigma;
  return robot;
}

LaserScan scan_of(const std::vector<float>& ranges) {
  return {.first_angle = -0.5 * pi,
          .angle_step = pi / static_cast<double>(ranges.size() - 1),
          .max_range = 8.0,
          .ranges = ranges};
}

Vector2d end_of(const LaserScan& scan, std::size_t beam) {
  return scan.ranges[beam] * Vector2d(std::cos(scan.angle(beam)), std::sin(scan.angle(beam)));
}

/// The least distance between a point and a segment from the origin, in closed form.
double distance_to_way(const Vector2d& point, const Vector2d& way) {
  const double part = std::clamp(point.dot(way) / way.squaredNorm(), 0.0, 1.0);
  return (point - part * way).norm();
}

TEST(ScanClearance, PointsThatTheBodyWouldTouchAreThoseNearItsWay) {
  test::Draw draw(3);
  const RobotModel robot = robot_of();
  int touched = 0;
  for (int k = 0; k < 200; ++k) {
    std::vector<float> ranges;
    for (int beam = 0; beam < 61; ++beam)
      ranges.push_back(static_cast<float>(draw.uniform(0.25, 0.85)));
    const LaserScan scan = scan_of(ranges);
    const double angle = draw.uniform(-0.8, 0.8);
    const Pose2 motion(0.5 * std::cos(angle), 0.5 * std::sin(angle), angle);
    const auto points = touched_points(beam_ends(scan), motion, robot);
    for (std::size_t beam = 0; beam < ranges.size(); ++beam) {
      const double apart = distance_to_way(end_of(scan, beam), motion.translation());
      const double near = robot.radius + std::min(kBetweenBeams, ranges[beam] * robot.lidar.step());
      if (std::abs(apart - near) < 1e-4) continue;  // the way is sampled
      const bool found = std::ranges::any_of(points, [&](const Vector2d& point) {
        return (point - end_of(scan, beam)).norm() < 1e-12;
      });
      EXPECT_EQ(found, apart < near) << apart;
    }
    touched += !points.empty();
  }
  EXPECT_GT(touched, 20);
}

TEST(ScanClearance, WhatIsTouchedAlreadyMayBeLeft) {
  // A point within the body: behind on the way, beside it, ahead of it.
  const auto points = [](double angle, const Pose2& motion) {
    LaserScan scan = scan_of(std::vector<float>(181, 8.0F));
    scan.ranges[static_cast<std::size_t>(std::lround((angle + 0.5 * pi) / scan.angle_step))] =
        0.15F;
    return touched_points(beam_ends(scan), motion, robot_of()).size();
  };
  for (int beam = 0; beam < 181; ++beam) {
    const double angle = -0.5 * pi + beam * pi / 180.0;
    EXPECT_EQ(points(angle, Pose2(-0.3 * std::cos(angle), -0.3 * std::sin(angle), 0.0)), 0U);
    EXPECT_EQ(points(angle, Pose2(0.0, 0.0, 0.3)), 0U) << "a turn";
  }
  EXPECT_EQ(points(0.5 * pi, Pose2(0.3, 0.0, 0.0)), 0U);
  EXPECT_EQ(points(0.0, Pose2(0.3, 0.0, 0.0)), 1U);
}

TEST(ScanClearance, NoisyRangesAreLetPassNearTheEdge) {
  LaserScan scan = scan_of(std::vector<float>(181, 8.0F));
  scan.ranges[90] = 0.66F;  // 0.16 m from the end of the way
  const Pose2 motion(0.5, 0.0, 0.0);
  EXPECT_EQ(touched_points(beam_ends(scan), motion, robot_of(0.01)).size(), 1U);
  EXPECT_EQ(touched_points(beam_ends(scan), motion, robot_of(0.05)).size(), 0U);
  scan.ranges[90] = 0.59F;  // within half the radius, however noisy
  EXPECT_EQ(touched_points(beam_ends(scan), motion, robot_of(0.5)).size(), 1U);
  for (const float none : {std::numeric_limits<float>::quiet_NaN(), 0.0F, 8.0F}) {
    scan.ranges[90] = none;
    EXPECT_TRUE(touched_points(beam_ends(scan), motion, robot_of()).empty());
  }
}

TEST(ScanClearance, ARobotThatDrivesAlongArcsTouchesWhatIsBesideThem) {
  const double curvature = 1.0 / 0.6;
  const Pose2 motion = along_arc(curvature, 0.5);
  LaserScan scan = scan_of(std::vector<float>(181, 8.0F));
  // 0.203 m to the right of the middle of the arc, farther from its chord.
  const Pose2 middle = along_arc(curvature, 0.25);
  const Vector2d point = middle * Vector2d(0.0, -0.203);
  const auto beam = static_cast<std::size_t>(
      std::lround((std::atan2(point.y(), point.x()) + 0.5 * pi) / scan.angle_step));
  scan.ranges[beam] = static_cast<float>(point.norm());
  EXPECT_EQ(touched_points(beam_ends(scan), motion, robot_of(0.0, MotionModel::dubins)).size(), 1U);
  EXPECT_EQ(touched_points(beam_ends(scan), motion, robot_of()).size(), 0U);
}

TEST(ScanClearance, AMotionBesideAnObstacleTouchesNothing) {
  const RobotModel robot = robot_of();
  LaserScan scan = scan_of(std::vector<float>(181, 8.0F));
  // A wall to the left, into whose edge the motion would lead.
  for (std::size_t beam = 105; beam < 181; ++beam) scan.ranges[beam] = 0.5F;
  const Pose2 motion(0.5, 0.0, 0.0);
  ASSERT_FALSE(touched_points(beam_ends(scan), motion, robot).empty());
  const auto beside = motion_beside(beam_ends(scan), motion, robot);
  ASSERT_TRUE(beside);
  EXPECT_TRUE(touched_points(beam_ends(scan), *beside, robot).empty());
  EXPECT_LT(beside->y(), 0.0);
  EXPECT_NEAR(beside->translation().norm(), 0.5, 1e-12);
  EXPECT_NEAR(std::atan2(beside->y(), beside->x()), beside->theta(), 1e-12) << "where it looks";
  RobotModel slow = robot;
  slow.turn = 0.01;
  EXPECT_FALSE(motion_beside(beam_ends(scan), motion, slow)) << "it can't turn so far";
  EXPECT_FALSE(motion_beside(beam_ends(scan), motion, robot_of(0.0, MotionModel::dubins)));
  // Shut in: half a motion would touch it, too.
  EXPECT_FALSE(motion_beside(beam_ends(scan_of(std::vector<float>(181, 0.3F))), motion, robot));
}

}  // namespace
}  // namespace cairn
