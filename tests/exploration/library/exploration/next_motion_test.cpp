// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"

namespace cairn {
namespace {

using std::numbers::pi;

/// Drives a path without noise; returns where it ends.
Pose2 driven(Pose2 at, const PlannedPath& path, const RobotModel& robot, int& motions) {
  std::size_t passed = 0;
  for (motions = 0; motions < 1000; ++motions) {
    const auto motion = next_motion(at, path, robot, passed);
    if (!motion) break;
    EXPECT_LE(motion->translation().norm(), robot.step + 1e-12);
    EXPECT_LE(std::abs(motion->theta()), robot.turn + 1e-12);
    at = at * *motion;
  }
  return at;
}

TEST(NextMotion, FollowsThePathAndLooksAtItsEnd) {
  const PlannedPath path{.points = {{0.0, 0.0}, {2.0, 0.0}, {2.0, 3.0}},
                         .length = 5.0,
                         .look_at = Eigen::Vector2d(0.0, 3.0)};
  int motions = 0;
  const Pose2 end = driven(Pose2(0.0, 0.0, pi), path, RobotModel{}, motions);
  EXPECT_LT((end.translation() - Eigen::Vector2d(2.0, 3.0)).norm(), 0.1 + 1e-9);
  EXPECT_NEAR(std::abs(end.theta()), pi, 0.07);
  // π in steps of 0.3 rad, 2 m and 3 m in steps of 0.5 m, and two quarter turns.
  EXPECT_LE(motions, 11 + 4 + 6 + 6 + 6 + 3);
}

TEST(NextMotion, TurnsOnTheSpotWhereItCannotTurnEnoughOnTheWay) {
  const PlannedPath path{.points = {{0.0, 0.0}, {0.0, 1.0}}, .length = 1.0, .look_at = {}};
  std::size_t passed = 0;
  const auto turn = next_motion(Pose2(0.0, 0.0, 0.0), path, RobotModel{}, passed);
  ASSERT_TRUE(turn);
  EXPECT_EQ(turn->translation().norm(), 0.0);
  EXPECT_DOUBLE_EQ(turn->theta(), 0.3);
  EXPECT_EQ(passed, 1U);
  const auto drive = next_motion(Pose2(0.0, 0.0, 0.5 * pi - 0.2), path, RobotModel{}, passed);
  ASSERT_TRUE(drive);
  EXPECT_NEAR(drive->translation().norm(), 0.5, 1e-12);
  EXPECT_NEAR(drive->theta(), 0.2, 1e-12);
}

TEST(NextMotion, EndsWhereNothingIsLeft) {
  std::size_t passed = 0;
  const PlannedPath here{.points = {{1.0, 1.0}}, .length = 0.0, .look_at = {}};
  EXPECT_FALSE(next_motion(Pose2(1.0, 1.0, 0.0), here, RobotModel{}, passed));
  const PlannedPath facing{.points = {}, .length = 0.0, .look_at = Eigen::Vector2d(5.0, 1.0)};
  passed = 0;
  EXPECT_FALSE(next_motion(Pose2(1.0, 1.0, 0.0), facing, RobotModel{}, passed));
}

}  // namespace
}  // namespace cairn
