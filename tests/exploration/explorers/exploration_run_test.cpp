// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/exploration/exploration.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/grid/floor_survey.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/typed/build.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "exploration/support/exploration_runs.hpp"
#include "support/data.hpp"

namespace cairn {
namespace {

using testing::HasSubstr;

using test::ExplorationParts;
using test::floor_named;
using test::kExactRobot;
using test::kNoisyRobot;
using test::kTrueMatcher;

class GeneratedFloors : public testing::TestWithParam<const char*> {};

TEST_P(GeneratedFloors, WithoutNoiseAllIsSeenAndNothingIsTouched) {
  const OccupancyGrid floor = floor_named(GetParam(), 3);
  ExplorationParts parts(kExactRobot);
  const ExplorationResult result = run_exploration(parts.on(floor));
  EXPECT_EQ(result.end, ExplorationEnd::finished) << result.why;
  EXPECT_EQ(result.collisions, 0);
  ASSERT_TRUE(result.against);
  EXPECT_GE(result.against->seen, 0.99 * result.against->floor);
  EXPECT_LE(result.against->occupied_wrong, 0.001 * result.against->floor);
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.trajectory.variable_count(), result.truth_trajectory.variable_count());
  EXPECT_EQ(result.steps.size(), static_cast<std::size_t>(result.trajectory.variable_count()));
}

INSTANTIATE_TEST_SUITE_P(Plans, GeneratedFloors,
                         testing::Values("rooms:width=14,height=10", "corridor:width=20,height=10",
                                         "loop:width=16,height=12", "cave:width=12,height=12"));

class RealFloors : public testing::TestWithParam<const char*> {};

/// Door posts and walls that are finer than the cells of the map.
TEST_P(RealFloors, WithoutNoiseAllIsSeenAndNothingIsTouched) {
  CAIRN_NEEDS_DATA();
  ExplorationParts parts(kExactRobot);
  const OccupancyGrid floor =
      read_grid((test::data_folder() / "maps" / (std::string(GetParam()) + ".yaml")).string(),
                parts.registry);
  const FloorSurvey survey = parts.make<FloorSurveyor>("round_body")
                                 ->survey(floor, {.radius = parts.world->robot().radius});
  Exploration run = parts.on(floor);
  run.reachable = survey.covered;
  const ExplorationResult result = run_exploration(run);
  EXPECT_EQ(result.end, ExplorationEnd::finished) << result.why;
  EXPECT_EQ(result.collisions, 0);
  ASSERT_TRUE(result.against && result.against->reachable_seen);
  EXPECT_GE(*result.against->reachable_seen, 0.99);
}

INSTANTIATE_TEST_SUITE_P(Maps, RealFloors, testing::Values("fr079", "stata_basement", "cave_20m"));

/// Another world, with a pane of glass across it that no beam shows.
class GlassWorld final : public World {
 public:
  GlassWorld(std::unique_ptr<World> world, double x) : world_(std::move(world)), x_(x) {}

  RobotModel robot() const override { return world_->robot(); }
  LaserScan begin(const WorldStart& start) override { return world_->begin(start); }
  std::optional<Pose2> truth() const override { return world_->truth(); }
  WorldStep move(const Pose2& motion) override {
    const double before = world_->truth()->x(), after = (*world_->truth() * motion).x();
    if (after <= x_) return world_->move(motion);
    const double part = 0.99 * std::max(0.0, (x_ - before) / (after - before));
    WorldStep step = world_->move(Pose2(part * motion.x(), part * motion.y(), 0.0));
    step.collided = true;
    return step;
  }

 private:
  std::unique_ptr<World> world_;
  double x_;
};

/// It finds that there is no way to what is left instead of driving against the glass again and
/// again.
TEST(ExplorationRun, WhatTheRobotTouchesTwiceIsInTheWayThoughNoScanShowsIt) {
  std::vector<std::string> rows(16, std::string(160, '.'));
  rows.front() = rows.back() = std::string(160, '#');
  for (std::string& row : rows) row.front() = row.back() = '#';
  const OccupancyGrid floor = test::drawn_floor(rows, 0.05);
  ExplorationParts parts(
      "lidar_building:relative=0,sigma_xy=1e-6,sigma_theta=1e-6,range_sigma=0,range=4");
  parts.world = std::make_unique<GlassWorld>(std::move(parts.world), 3.0);
  Exploration run = parts.on(floor);
  run.start.pose = Pose2(1.0, 0.4, 0.0);
  const ExplorationResult result = run_exploration(run);
  EXPECT_EQ(result.end, ExplorationEnd::stuck) << result.why;  // what is behind the glass is left
  EXPECT_THAT(result.why, HasSubstr("that can be reached"));
  EXPECT_GE(result.collisions, 2);
  EXPECT_LT(result.collisions, 10);
}

/// Everything but times.
void expect_equal(const ExplorationResult& a, const ExplorationResult& b) {
  ASSERT_EQ(a.steps.size(), b.steps.size());
  for (std::size_t k = 0; k < a.steps.size(); ++k) {
    ASSERT_EQ(a.steps[k].estimate.x(), b.steps[k].estimate.x());
    ASSERT_EQ(a.steps[k].map_entropy, b.steps[k].map_entropy);
    ASSERT_EQ(a.steps[k].trajectory_entropy, b.steps[k].trajectory_entropy);
  }
  EXPECT_EQ(a.why, b.why);
  EXPECT_EQ(a.slam.loops, b.slam.loops);
  EXPECT_EQ(a.map.log_odds, b.map.log_odds);
}

TEST(Exploration, TheSameSeedGivesTheSameRun) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  for (const char* explorer : {"frontier", "random"}) {
    ExplorationParts first(kNoisyRobot, explorer), second(kNoisyRobot, explorer),
        other(kNoisyRobot, explorer);
    Exploration a = first.on(floor, 7), b = second.on(floor, 7), c = other.on(floor, 8);
    a.limits.distance = b.limits.distance = c.limits.distance = 15.0;
    const ExplorationResult run = run_exploration(a);
    expect_equal(run, run_exploration(b));
    EXPECT_NE(run.steps.back().estimate.x(), run_exploration(c).steps.back().estimate.x());
  }
}

TEST(Exploration, LimitsEndARun) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  const auto run = [&](const ExplorationLimits& limits) {
    ExplorationParts parts(kNoisyRobot);
    Exploration exploration = parts.on(floor);
    exploration.limits = limits;
    return run_exploration(exploration);
  };
  const ExplorationResult far = run({.distance = 5.0});
  EXPECT_EQ(far.end, ExplorationEnd::limit);
  EXPECT_GE(far.steps.back().distance, 5.0);
  EXPECT_LT(far.steps.back().distance, 6.0);
  EXPECT_THAT(far.why, HasSubstr("5 m"));
  EXPECT_EQ(run({.steps = 7}).steps.size(), 8U);
  EXPECT_EQ(run({.decisions = 2}).decision_seconds.size(), 2U);
}

TEST(Exploration, EndsOnceEnoughIsKnown) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  ExplorationParts parts(kNoisyRobot);
  const FloorSurvey survey = parts.make<FloorSurveyor>("round_body")
                                 ->survey(floor, {.radius = parts.world->robot().radius});
  Exploration exploration = parts.on(floor);
  exploration.limits.known = 0.6;
  EXPECT_THROW(run_exploration(exploration), Error);  // of what?
  exploration.reachable = survey.covered;
  exploration.limits.known = 2.0;
  EXPECT_THROW(run_exploration(exploration), Error);
  exploration.limits.known = 0.6;
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.end, ExplorationEnd::limit);
  EXPECT_THAT(result.why, HasSubstr("of what the body can cover is seen"));
  EXPECT_GE(*result.against->reachable_seen, 0.6 - 0.02);  // aligned anew at the end
  EXPECT_LT(*result.against->reachable_seen, 0.99);
}

TEST(Exploration, EndsOnceTheLastMetresBringLittle) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  ExplorationParts parts(kNoisyRobot);
  Exploration exploration = parts.on(floor);
  exploration.limits = {.distance = 200.0, .rate = 2.0};
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.end, ExplorationEnd::limit) << result.why;
  EXPECT_THAT(result.why, HasSubstr("the last 20 m brought"));
  const ExplorationStep& last = result.steps.back();
  const auto before =
      std::find_if(result.steps.rbegin(), result.steps.rend(), [&](const auto& step) {
        return step.distance <= last.distance - ExplorationLimits::kRateDistance;
      });
  ASSERT_NE(before, result.steps.rend());
  EXPECT_LT(last.coverage - before->coverage, 2.0 * (last.distance - before->distance));
}

/// The robot does not know where on the floor it is; estimate and truth begin at one pose.
TEST(Exploration, BeginsAtAnUnknownPlaceAndAngle) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  std::vector<double> headings;
  for (const std::uint64_t seed : {3U, 3U, 4U}) {
    ExplorationParts parts(kExactRobot);
    Exploration exploration = parts.on(floor, seed);
    exploration.limits.distance = 10.0;
    const ExplorationResult result = run_exploration(exploration);
    ASSERT_TRUE(result.start);
    headings.push_back(result.start->theta());
    EXPECT_EQ(result.steps.front().estimate.state(), Pose2().state());
    EXPECT_EQ(result.steps.front().truth->state(), Pose2().state());
    // What is drawn at an angle is compared at that angle.
    EXPECT_LT(result.steps.back().estimate.between(*result.steps.back().truth).log().norm(), 0.01);
    EXPECT_LE(result.against->free_wrong + result.against->occupied_wrong, 0.5);
    EXPECT_GT(result.against->seen, 10.0);
  }
  EXPECT_EQ(headings[0], headings[1]);
  EXPECT_NE(headings[0], headings[2]);
  ExplorationParts parts(kExactRobot);
  Exploration exploration = parts.on(floor);
  exploration.limits.steps = 1;
  exploration.start.pose = Pose2(2.0, 2.5, 1.0);
  EXPECT_LT(run_exploration(exploration).start->local(*exploration.start.pose).norm(), 1e-12);
}

/// Noise of odometry adds up to metres that nobody has driven.
TEST(Exploration, CountsWhatItHasTrulyDriven) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  ExplorationParts parts("lidar_building:sigma_xy=0.1");
  Exploration exploration = parts.on(floor);
  exploration.limits.steps = 60;
  const ExplorationResult result = run_exploration(exploration);
  double driven = 0.0;
  for (std::size_t k = 1; k < result.steps.size(); ++k) {
    const Pose2& before = *result.steps[k - 1].truth;
    driven += before.between(*result.steps[k].truth).translation().norm();
    EXPECT_NEAR(result.steps[k].distance, driven, 1e-9);
  }
}

/// Matches no scan.
class NoRegistration final : public Registration {
 public:
  void begin(const RegistrationData&) override {}
  std::vector<Factor> match(Id, Id) override { return {}; }
};

TEST(Exploration, SaysHowFarItDroveByOdometryAlone) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  for (const bool matched : {true, false}) {
    ExplorationParts parts(kNoisyRobot);
    if (!matched) parts.registration = std::make_unique<NoRegistration>();
    Exploration exploration = parts.on(floor);
    exploration.match_consecutive = true;
    exploration.limits.distance = 25.0;
    const ExplorationResult result = run_exploration(exploration);
    EXPECT_THAT(result.notes,
                testing::Contains(HasSubstr("25 m by odometry alone")).Times(matched ? 0 : 1));
  }
}

/// Twelve runs by odometry alone: their errors are as large as the covariances say, and a note says
/// so where that is much.
TEST(Exploration, PredictsTheErrorOfItsTrajectory) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  double errors = 0.0, predicted = 0.0;
  int noted = 0, large = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    ExplorationParts parts("lidar_building:relative=0.1,sigma_xy=0.02,sigma_theta=0.02");
    parts.registration = std::make_unique<NoRegistration>();
    Exploration exploration = parts.on(floor, seed);
    exploration.limits.distance = 15.0;
    const ExplorationResult result = run_exploration(exploration);
    const double ate =
        compare(trajectory(result.trajectory), trajectory(result.truth_trajectory)).ate_translation;
    errors += ate * ate;
    predicted += result.expected_ate * result.expected_ate;
    large += result.expected_ate > 0.2;
    for (const std::string& note : result.notes)
      noted += note.find("positions are uncertain") != std::string::npos;
  }
  EXPECT_GT(errors, 0.5 * predicted);
  EXPECT_LT(errors, 2.0 * predicted);
  EXPECT_EQ(noted, large);
  EXPECT_GT(large, 0);
}

TEST(Exploration, AnInterruptEndsItWithItsResults) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  ExplorationParts parts(kNoisyRobot);
  Exploration exploration = parts.on(floor);
  std::atomic<bool> interrupt{false};
  exploration.interrupt = &interrupt;
  exploration.moved = [&](const ExplorationStep& step, const FloorMap&) {
    interrupt = step.step == 10;
  };
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.end, ExplorationEnd::interrupted);
  EXPECT_EQ(result.steps.size(), 11U);
  EXPECT_EQ(result.trajectory.variable_count(), 11);
  EXPECT_GT(result.map.coverage(), 0.0);
}

/// Is interrupted while it decides, and says then that nothing is left.
class InterruptedExplorer final : public Explorer {
 public:
  InterruptedExplorer(std::atomic<bool>& interrupt, std::unique_ptr<Explorer> other)
      : interrupt_(interrupt), other_(std::move(other)) {}
  void begin(std::uint64_t seed) override { other_->begin(seed); }
  Decision decide(const Situation& situation) override {
    if (situation.decision > 0) {
      EXPECT_FALSE(situation.interrupted());
      interrupt_ = true;
      EXPECT_TRUE(situation.interrupted());
    }
    return other_->decide(situation);
  }

 private:
  std::atomic<bool>& interrupt_;
  std::unique_ptr<Explorer> other_;
};

TEST(Exploration, ADecisionThatIsInterruptedDoesNotCount) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  for (const std::string& name : Registry().names(Explorer::kKind)) {
    SCOPED_TRACE(name);
    ExplorationParts parts(kExactRobot, name);
    std::atomic<bool> interrupt{false};
    parts.explorer = std::make_unique<InterruptedExplorer>(interrupt, std::move(parts.explorer));
    Exploration exploration = parts.on(floor);
    exploration.interrupt = &interrupt;
    int decided = 0;
    exploration.decided = [&](const Decision&, const Situation&) { ++decided; };
    const ExplorationResult result = run_exploration(exploration);
    EXPECT_EQ(result.end, ExplorationEnd::interrupted) << result.why;
    EXPECT_EQ(decided, 1);
    EXPECT_EQ(result.decision_seconds.size(), 1U);
    EXPECT_GT(result.map.coverage(), 0.0);
  }
}

TEST(Exploration, AFrontierIsNotSearchedForOnceTheRunIsInterrupted) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  ExplorationParts parts(kExactRobot);
  Exploration exploration = parts.on(floor);
  exploration.limits.decisions = 1;
  std::size_t without = 0, with = 99;
  const auto again = parts.make<Explorer>("frontier");
  exploration.decided = [&](const Decision&, const Situation& situation) {
    std::atomic<bool> interrupt{false};
    Situation asked = situation;
    asked.interrupt = &interrupt;
    again->begin(1);
    without = again->decide(asked).candidates.size();
    interrupt = true;
    with = again->decide(asked).candidates.size();
  };
  run_exploration(exploration);
  EXPECT_GT(without, 0U);
  EXPECT_EQ(with, 0U);
}

TEST(Exploration, ATreeIsNotGrownOnceTheRunIsInterrupted) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  for (const char* name : {"drrt_star", "errt_star"}) {
    SCOPED_TRACE(name);
    ExplorationParts parts(kNoisyRobot, name);
    Exploration exploration = parts.on(floor);
    exploration.limits.decisions = 1;
    std::size_t without = 99, with = 99;
    const auto again = parts.make<Explorer>(name);
    exploration.decided = [&](const Decision& decision, const Situation& situation) {
      without = decision.tree.size();
      const std::atomic<bool> interrupt{true};
      Situation asked = situation;
      asked.interrupt = &interrupt;
      again->begin(1);
      with = again->decide(asked).tree.size();
    };
    run_exploration(exploration);
    EXPECT_GT(without, 10U);
    EXPECT_EQ(with, 0U);
  }
}

/// Drives back and forth between two places.
class Pendulum final : public Explorer {
 public:
  void begin(std::uint64_t) override {}
  Decision decide(const Situation& situation) override {
    Decision decision;
    const double side = situation.decision % 2 == 0 ? 1.0 : -1.0;
    const Eigen::Vector2d at = situation.pose.translation();
    decision.candidates.push_back({{.points = {at, at + Eigen::Vector2d(side, 0.0)}}, 0.0, ""});
    return decision;
  }
};

/// Stays where it is.
class Idler final : public Explorer {
 public:
  void begin(std::uint64_t) override {}
  Decision decide(const Situation& situation) override {
    Decision decision;
    decision.candidates.push_back({{.points = {situation.pose.translation()}}, 0.0, ""});
    return decision;
  }
};

/// A room of which a part is unknown, behind a frontier that stays however often it is looked at.
class FrontierThatStays : public testing::Test {
 protected:
  FrontierThatStays() {
    for (int y = 0; y < 40; ++y)
      rows_.push_back(y == 0 || y == 39 ? std::string(120, '#')
                                        : "#" + std::string(79, '.') + std::string(40, ' '));
    parts_.explorer->begin(1);
  }
  /// What is decided at a pose.
  Decision decision_at(const Pose2& pose) {
    if (std::exchange(drawn_, rows_) != rows_) map_ = test::drawn_map(rows_, 0.1);
    const int row = static_cast<int>(frontier_row_);
    const auto cell = static_cast<std::int32_t>(map_.frame.index(79, row));
    map_.frontiers = {{.cells = {cell}, .length = 0.5, .middle = map_.frame.centre(79, row)}};
    return parts_.explorer->decide({.estimator = parts_.policy->estimator(),
                                    .poses = poses_,
                                    .pose = pose,
                                    .map = map_,
                                    .robot = parts_.world->robot()});
  }
  /// Its first pose, from where it has driven to where decisions are made.
  void begin_at(const Pose2& pose) {
    Variable first = make_variable(0, pose);
    first.fixed = true;
    parts_.policy->add_pose(first, {});
    parts_.policy->end_pose();
    poses_.push_back(0);
  }
  static bool drives(const Decision& decision) {
    return decision.kind == Decision::Kind::drive &&
           !decision.candidates.at(decision.chosen).path.points.empty();
  }
  /// Whether a robot that stands in the room drives there, which it does to the end.
  bool is_tried() {
    Pose2 pose = start_;
    for (int decisions = 0; decisions < 10; ++decisions) {
      const Decision decision = decision_at(pose);
      if (!drives(decision)) return decisions > 0;
      const PlannedPath& path = decision.candidates.at(decision.chosen).path;
      const Eigen::Vector2d end = path.points.back(), ahead = *path.look_at - end;
      pose = Pose2(end.x(), end.y(), std::atan2(ahead.y(), ahead.x()));
    }
    ADD_FAILURE() << "it is never given up";
    return true;
  }
  /// So many cells in a column behind the frontier are known to be free.
  void see(std::size_t column, std::size_t cells) {
    for (std::size_t k = 0; k < cells; ++k) rows_[20 + k][column] = '.';
  }
  /// A wall across the room.
  void close(std::size_t column, char cell) {
    for (std::size_t k = 1; k < 39; ++k) rows_[k][column] = cell;
  }
  /// A wall with a door of 0.4 m, which is as wide as the robot.
  void narrow(std::size_t column) {
    close(column, '#');
    for (std::size_t k = 18; k < 22; ++k) rows_[k][column] = '.';
  }

  FloorMap map_;
  const Pose2 start_{2.05, 2.05, 0.0};
  std::size_t frontier_row_ = 20;
  std::vector<std::string> rows_, drawn_;
  std::vector<Id> poses_;
  ExplorationParts parts_{kExactRobot};
};

TEST_F(FrontierThatStays, IsTriedAgainWhenTheMapChangesAndAfterTwiceInVainWhenMoreOfItIsKnown) {
  EXPECT_TRUE(is_tried());
  EXPECT_FALSE(is_tried());
  see(85, 1);
  EXPECT_TRUE(is_tried()) << "a cell has changed";
  EXPECT_FALSE(is_tried());
  see(86, 1);
  EXPECT_FALSE(is_tried()) << "a cell is too little by now";
  for (const std::size_t column : {83, 84, 87}) see(column, 8);
  EXPECT_TRUE(is_tried()) << "a quarter of a square metre";
}

/// How often a robot drives that is stopped each time after a few decimetres, at the same place.
TEST_F(FrontierThatStays, IsGivenUpWhereTheRobotDoesNotComeNearer) {
  const auto tries_at = [&](const Pose2& pose, double moved, double turned = 0.0) {
    int tries = 0;
    while (tries < 100 &&
           drives(decision_at(pose * Pose2(tries % 2 * moved, 0.0, tries % 2 * turned))))
      ++tries;
    return tries;
  };
  EXPECT_EQ(tries_at(start_, 0.2), 8);
  EXPECT_EQ(tries_at(start_, 0.2), 0) << "given up until more of the map around it is known";
  EXPECT_EQ(tries_at(start_ * Pose2(0.3, 0.0, 0.0), 0.2), 0);
  EXPECT_EQ(tries_at(start_ * Pose2(2.0, 0.0, 0.0), 0.2), 8) << "or the robot is nearer";
  for (const std::size_t column : {84, 85, 86}) see(column, 8);
  EXPECT_EQ(tries_at(start_, 0.2), 8);
  parts_.explorer->begin(2);
  EXPECT_EQ(tries_at(start_, 0.0), 8) << "it has backed off to where it was";
  parts_.explorer->begin(3);
  EXPECT_EQ(tries_at(start_, 0.0, 0.3), 32) << "a robot that has only turned was not stopped";
}

TEST_F(FrontierThatStays, IsNotGivenUpOnAWayThatIsDecidedAnewEachMetre) {
  for (double x = 0.0; x < 5.0; x += 0.6) {
    EXPECT_TRUE(drives(decision_at(start_ * Pose2(x, 0.0, 0.0)))) << x;
    EXPECT_TRUE(drives(decision_at(start_ * Pose2(x, 0.0, 0.0)))) << x;
  }
}

TEST_F(FrontierThatStays, ANarrowDoorIsTriedOnce) {
  // A choice along an ordinary path, before the door seemed to be narrow, does not count.
  ASSERT_TRUE(drives(decision_at(start_)));
  narrow(50);
  const Decision decision = decision_at(start_ * Pose2(0.2, 0.0, 0.0));
  ASSERT_TRUE(drives(decision));
  const PlannedPath& path = decision.candidates.at(decision.chosen).path;
  EXPECT_NEAR(path.radius, 0.1, 1e-9);
  EXPECT_GT(path.points.back().x(), 5.5);
  EXPECT_FALSE(drives(decision_at(start_))) << "it was stopped, and has come no nearer";
}

TEST_F(FrontierThatStays, AfterSixNarrowDoorsInARowNoneIsTriedUnlessTheRobotIsShutIn) {
  narrow(50);
  const auto tries = [&] {
    int count = 0;
    for (std::size_t door = 0; door < 8; ++door) {
      // Another frontier each time, which stays unknown.
      frontier_row_ = 2 + 5 * door;
      count += drives(decision_at(start_ * Pose2(door % 2 * 0.2, 0.0, 0.0)));
    }
    return count;
  };
  EXPECT_EQ(tries(), 6);
  parts_.explorer->begin(1);
  begin_at(Pose2(6.5, 2.0, 0.0));
  EXPECT_EQ(tries(), 8);
}

TEST_F(FrontierThatStays, ARobotTurnsOnceAroundBeforeItEndsForWantOfAPath) {
  const double turn = parts_.world->robot().turn;
  const int motions = static_cast<int>(std::ceil(2.0 * std::numbers::pi / turn));
  close(50, '#');
  // Once more where it has driven on.
  for (Pose2 pose : {start_, start_ * Pose2(1.0, 0.0, 0.0)}) {
    for (int k = 0; k < motions; ++k) {
      const Decision decision = decision_at(pose);
      ASSERT_EQ(decision.kind, Decision::Kind::drive) << k;
      ASSERT_FALSE(drives(decision)) << k;
      const PlannedPath& path = decision.candidates.at(decision.chosen).path;
      std::size_t passed = 0;
      const auto motion = next_motion(pose, path, parts_.world->robot(), passed);
      ASSERT_TRUE(motion) << k;
      EXPECT_NEAR(motion->theta(), turn, 1e-9);
      pose = pose * *motion;
      EXPECT_FALSE(next_motion(pose, path, parts_.world->robot(), passed)) << k;
      if (k == 3) {
        // A way that is there for one scan only begins no other circle.
        close(50, '.');
        EXPECT_TRUE(drives(decision_at(pose)));
        close(50, '#');
      }
    }
    EXPECT_EQ(decision_at(pose).kind, Decision::Kind::finished);
  }
}

TEST(Exploration, ARunWithoutProgressIsStuckAndSaysWhy) {
  const OccupancyGrid floor = floor_named("rooms:width=12,height=9", 5);
  {
    ExplorationParts parts(kExactRobot);
    parts.explorer = std::make_unique<Pendulum>();
    const ExplorationResult result = run_exploration(parts.on(floor));
    EXPECT_EQ(result.end, ExplorationEnd::stuck);
    EXPECT_THAT(result.why, HasSubstr("m were driven without finding more floor"));
    EXPECT_LT(result.steps.back().distance, 60.0);
  }
  {
    // Not on one long way: five ways count as the whole at most.
    ExplorationParts parts(kExactRobot);
    parts.explorer = std::make_unique<Pendulum>();
    Exploration exploration = parts.on(floor);
    exploration.limits.idle_distance = 0.5;
    const ExplorationResult result = run_exploration(exploration);
    EXPECT_EQ(result.end, ExplorationEnd::stuck);
    EXPECT_GE(result.steps.back().decision, 5);
    EXPECT_LT(result.steps.back().distance, 20.0);
  }
  ExplorationParts parts(kExactRobot);
  parts.explorer = std::make_unique<Idler>();
  const ExplorationResult result = run_exploration(parts.on(floor));
  EXPECT_EQ(result.end, ExplorationEnd::stuck);
  EXPECT_THAT(result.why, HasSubstr("led to no motion"));
}

TEST(Exploration, LoopsKeepAnUncertainRobotNearTheTruth) {
  const OccupancyGrid floor = floor_named("loop:width=16,height=12", 3);
  const auto error = [&](const char* registration) {
    double sum = 0.0;
    for (const std::uint64_t seed : {4, 5, 6, 7}) {
      ExplorationParts parts("lidar_building:relative=0.1,sigma_theta=0.02");
      parts.registration = parts.make<Registration>(registration);
      Exploration exploration = parts.on(floor, seed);
      exploration.limits.distance = 60.0;
      const ExplorationResult result = run_exploration(exploration);
      double of_run = 0.0;
      for (const ExplorationStep& step : result.steps)
        of_run += (step.estimate.translation() - step.truth->translation()).norm();
      sum += of_run / static_cast<double>(result.steps.size());
    }
    return sum;
  };
  EXPECT_LT(error(kTrueMatcher), 0.5 * error("simulated:range=0.001"));
}

}  // namespace
}  // namespace cairn
