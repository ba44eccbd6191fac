// SPDX-License-Identifier: BSD-3-Clause
// Robots that move in different ways: what the world lets them do, and that explorers explore with
// each.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/dubins_curve.hpp"
#include "cairn/exploration/exploration.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "exploration/support/exploration_runs.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

std::string exact(const std::string& motion) {
  return std::string(test::kExactRobot) + ",motion=" + motion;
}

std::unique_ptr<World> robot(const std::string& motion) {
  return Registry().make<World>(parse_component(exact(motion)));
}

TEST(MotionModel, DubinsDrivesAlongArcsAndRefusesOthers) {
  const OccupancyGrid floor = test::floor_named("rooms:width=9,height=7", 1);
  const auto world = robot("dubins,turning_radius=0.5");
  world->begin({.floor = &floor});
  const Pose2 before = *world->truth();
  const Pose2 arc = along_arc(2.0, 0.15);
  world->move(arc);
  EXPECT_LT(before.between(*world->truth()).local(arc).norm(), 1e-12);
  world->move(Pose2(-0.05, 0.0, 0.0));  // straight back
  for (const Pose2& motion : {Pose2(0.0, 0.0, 0.1), along_arc(2.1, 0.15), Pose2(0.2, 0.1, 0.0)}) {
    try {
      world->move(motion);
      ADD_FAILURE() << to_string(motion);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      EXPECT_THAT(error.what(), HasSubstr("turning_radius"));
    }
  }
}

TEST(MotionModel, ATurningRadiusOfARobotThatTurnsInPlaceIsRefused) {
  for (const char* motion : {"differential", "holonomic"}) {
    try {
      robot(std::string(motion) + ",turning_radius=0.5");  // the default, but it was given
      ADD_FAILURE() << motion;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      EXPECT_THAT(error.what(), HasSubstr("motion=dubins"));
      EXPECT_THAT(error.what(), HasSubstr(motion));
    }
  }
  EXPECT_EQ(robot("dubins,turning_radius=0.7")->robot().turning_radius, 0.7);
  EXPECT_EQ(robot("dubins")->robot().turning_radius, 0.5);
}

TEST(MotionModel, ABodyOnAnArcStopsAtAWall) {
  // 8 m × 6 m inside, with cells of 1 m.
  const OccupancyGrid floor =
      test::drawn_floor({"##########", "#........#", "#........#", "#........#", "#........#",
                         "#........#", "#........#", "##########"});
  const auto world = robot("dubins,turning_radius=1,radius=0.3,step=20,turn=3.14");
  // Heads for the wall at x = 9, and would leave it again, 0.1 m too late.
  world->begin({.floor = &floor, .pose = Pose2(7.8, 3.0, 0.0)});
  const WorldStep step = world->move(along_arc(1.0, 3.0));
  EXPECT_TRUE(step.collided);
  const Pose2 end = *world->truth();
  EXPECT_LE(end.x(), 8.7 + 1e-9);
  EXPECT_GT(end.x(), 8.7 - 0.3);
  // It is on the circle, and heads along it.
  EXPECT_NEAR(std::hypot(end.x() - 7.8, end.y() - 4.0), 1.0, 1e-9);
  EXPECT_NEAR(end.theta(), std::atan2(end.y() - 4.0, end.x() - 7.8) + 0.5 * pi, 1e-9);
  world->begin({.floor = &floor, .pose = Pose2(7.6, 3.0, 0.0)});
  EXPECT_FALSE(world->move(along_arc(1.0, 3.0)).collided);
}

struct Case {
  std::string explorer, motion;
  friend std::ostream& operator<<(std::ostream& out, const Case& of) {
    return out << of.explorer << " with a robot that is " << of.motion;
  }
};

/// One that decides by frontiers, and one by a tree of paths.
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* explorer : {"frontier", "drrt_star:density=3"}) {
    for (const char* motion : {"differential", "holonomic", "dubins,turning_radius=0.4"})
      all.push_back({explorer, motion});
  }
  return all;
}

class MotionModels : public testing::TestWithParam<Case> {};

TEST_P(MotionModels, ExploreWithoutACollision) {
  const OccupancyGrid floor = test::floor_named("rooms:width=9,height=7", 1);
  test::ExplorationParts parts(exact(GetParam().motion), GetParam().explorer);
  Exploration exploration = parts.on(floor);
  exploration.limits.distance = 30.0;
  const RobotModel model = parts.world->robot();
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.collisions, 0);
  EXPECT_NE(result.end, ExplorationEnd::stuck) << result.why;
  ASSERT_TRUE(result.against);
  EXPECT_GT(result.against->seen, 0.5 * result.against->floor) << result.why;
  // Every motion is one that the robot can make.
  for (std::size_t k = 1; k < result.steps.size(); ++k) {
    const Pose2 motion = result.steps[k - 1].truth->between(*result.steps[k].truth);
    EXPECT_LE(motion.translation().norm(), model.step + 1e-6);
    EXPECT_LE(std::abs(motion.theta()), model.turn + 1e-6);
    if (model.motion != MotionModel::dubins) continue;
    const double half = 0.5 * motion.theta();
    // Ahead, or back.
    const double way = motion.x() > 0.0 ? 1.0 : -1.0;
    EXPECT_NEAR(std::atan2(way * motion.y(), way * motion.x()), half, 1e-4);
    // A chord of a circle that is not narrower.
    EXPECT_LE(std::abs(std::sin(half)) * 2.0 * model.turning_radius,
              motion.translation().norm() + 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(OfExplorers, MotionModels, testing::ValuesIn(cases()));

/// At the end of a dead end, which it faces, with nothing known behind it: it backs.
TEST(MotionModel, ARobotThatCannotTurnLeavesADeadEnd) {
  std::vector<std::string> rows(60, std::string(120, '#'));
  for (std::size_t y = 20; y < 30; ++y) rows[y].replace(2, 80, std::string(80, '.'));
  for (std::size_t y = 2; y < 58; ++y) rows[y].replace(2, 36, std::string(36, '.'));
  const OccupancyGrid floor = test::drawn_floor(rows, 0.1);
  for (const char* explorer : {"frontier", "drrt_star:density=3"}) {
    SCOPED_TRACE(explorer);
    if (!Registry().has(Explorer::kKind, parse_component(explorer).name)) continue;
    test::ExplorationParts parts(exact("dubins"), explorer);
    Exploration exploration = parts.on(floor);
    exploration.start.pose = Pose2(7.8, 0.1 * (60 - 25), 0.0);
    exploration.limits.distance = 40.0;
    const ExplorationResult result = run_exploration(exploration);
    EXPECT_EQ(result.end, ExplorationEnd::finished);
    ASSERT_TRUE(result.against);
    EXPECT_GT(result.against->seen, 0.99 * result.against->floor) << result.why;
  }
}

/// Drives to one place, and lists no other.
class OneGoal final : public Explorer {
 public:
  void begin(std::uint64_t) override {}
  Decision decide(const Situation& situation) override {
    const Eigen::Vector2d at = situation.pose.translation();
    Decision decision;
    decision.why = "back";
    const Eigen::Vector2d behind = situation.pose * Eigen::Vector2d(-1.0, 0.0);
    decision.candidates.push_back({{.points = {at, behind}, .length = 1.0}, 0.0, "behind it"});
    return decision;
  }
};

TEST(MotionModel, WhereNoCurveLeadsItGoesBackAndSaysSo) {
  // The floor that it knows is too small for a circle of 3 m.
  const OccupancyGrid floor = test::floor_named("rooms:width=9,height=7", 1);
  test::ExplorationParts parts(exact("dubins,turning_radius=3"));
  parts.explorer = std::make_unique<OneGoal>();
  std::string why;
  Exploration exploration = parts.on(floor);
  exploration.decided = [&](const Decision& decision, const Situation&) { why = decision.why; };
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.end, ExplorationEnd::stuck);
  EXPECT_THAT(why, HasSubstr("can't follow that path, nor another: it goes back"));
  EXPECT_THAT(result.notes, testing::Contains(HasSubstr("turning radius of 3 m")));
  EXPECT_GT(result.steps.size(), 1U);
}

}  // namespace
}  // namespace cairn
