// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_motions.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(PathMotions, LeadAlongThePathInSteps) {
  const Pose2 from(1.0, 2.0, 3.0);
  PlannedPath path{.points = {{1.0, 2.0}, {4.2, 2.0}, {4.2, 5.0}}, .length = 6.2};
  path.look_at = Eigen::Vector2d(0.0, 5.0);
  const RobotModel robot;
  Pose2 at = from;
  double driven = 0.0;
  const std::vector<Pose2> motions = motions_along(from, path, robot);
  for (const Pose2& motion : motions) {
    EXPECT_LE(motion.translation().norm(), robot.step + 1e-12);
    EXPECT_LE(std::abs(motion.theta()), robot.turn + 1e-12);
    at = at * motion;
    driven += motion.translation().norm();
  }
  EXPECT_LT((at.translation() - path.points.back()).norm(), 0.11);
  EXPECT_NEAR(driven, path.length, 0.4);
  const Eigen::Vector2d seen = at.transform_to(*path.look_at);
  EXPECT_LT(std::abs(std::atan2(seen.y(), seen.x())), 0.02);
  EXPECT_GE(motions.size(), 6.2 / robot.step);
}

TEST(PathMotions, NoneWhereTheRobotIsThereAlready) {
  const Pose2 from(1.0, 2.0, 3.0);
  PlannedPath path;
  path.points = {{1.0, 2.0}};
  EXPECT_TRUE(motions_along(from, path, RobotModel()).empty());
}

/// A robot that neither drives nor turns does not go on for ever.
TEST(PathMotions, EndForARobotThatDoesNotMove) {
  RobotModel still;
  still.step = still.turn = 0.0;
  PlannedPath path;
  path.points = {{0.0, 1.0}};
  EXPECT_LT(motions_along(Pose2(), path, still).size(), 5000U);
}

}  // namespace
}  // namespace cairn
