// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/exploration.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/planning/free_space.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/planning/path_information.hpp"
#include "cairn/planning/path_motions.hpp"
#include "cairn/plugin/registry.hpp"
#include "exploration/support/exploration_runs.hpp"
#include "exploration/tree_explorers/known_floor.hpp"

namespace cairn {
namespace {

using testing::HasSubstr;

using test::ExplorationParts;
using test::kExactRobot;
using test::kNoisyRobot;

class TreeExplorers : public testing::TestWithParam<const char*> {};

TEST_P(TreeExplorers, DriveAlongTheBestPathOfTheirTree) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 3).floor;
  ExplorationParts parts(kNoisyRobot, std::string(GetParam()) + ":density=2");
  Exploration exploration = parts.on(floor);
  exploration.limits.decisions = 5;
  int driven = 0;
  exploration.decided = [&](const Decision& decision, const Situation& situation) {
    ASSERT_FALSE(decision.tree.empty()) << decision.why;
    EXPECT_EQ(decision.tree.front().parent, -1);
    double least = 0.0;
    for (const TreePose& node : decision.tree) least = std::min(least, node.value);
    for (std::size_t k = 1; k < decision.tree.size(); ++k) EXPECT_GE(decision.tree[k].parent, 0);
    if (least == 0.0) return;
    ++driven;
    ASSERT_EQ(decision.kind, Decision::Kind::drive);
    const Candidate& chosen = decision.candidates.at(decision.chosen);
    EXPECT_EQ(chosen.value, least);
    ASSERT_TRUE(chosen.change);
    EXPECT_LE(chosen.change->map, 0.0);
    EXPECT_EQ(chosen.path.points.front(), situation.pose.translation());
    const FreeSpace space(situation.map, situation.pose.translation(), situation.robot.radius);
    for (std::size_t k = space.entry().size(); k < chosen.path.points.size(); ++k)
      EXPECT_TRUE(space.is_clear(chosen.path.points[k - 1], chosen.path.points[k]));
    for (const Candidate& other : decision.candidates) EXPECT_GE(other.value, chosen.value);
  };
  run_exploration(exploration);
  EXPECT_GT(driven, 2);
}

/// What a tree estimates by two poses of the graph alone is exact where it decides.
TEST_P(TreeExplorers, ListCandidatesWithExactValues) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 3).floor;
  ExplorationParts parts(kNoisyRobot,
                         std::string(GetParam()) + ":density=2,sampled_poses=2,loop_gain=0.1");
  Exploration exploration = parts.on(floor);
  exploration.limits.decisions = 8;
  int with_loops = 0;
  exploration.decided = [&](const Decision& decision, const Situation& situation) {
    const FloorMap& map = situation.map;
    const auto in_sight = [&](const Pose2& older, const Pose2& newer) {
      const auto cell = [&](const Pose2& at) { return map.frame.to_cells(at.translation()); };
      return traverse_cells(cell(older), cell(newer), [&](int x, int y) {
        return !map.frame.contains(x, y) || map.cells[map.frame.index(x, y)] != CellState::occupied;
      });
    };
    PathInformation information(situation, {.loop_gain = 0.1}, in_sight);
    for (const Candidate& candidate : decision.candidates) {
      if (!candidate.change || candidate.path.points.size() < 2) continue;
      PathInformation::State path = information.start();
      for (std::size_t k = 1; k < candidate.path.points.size(); ++k) {
        const PlannedPath segment{.points = {candidate.path.points[k]}, .length = 1.0};
        path = information.extended(path, motions_along(path.pose(), segment, situation.robot));
      }
      EXPECT_THAT(candidate.what, HasSubstr(std::to_string(path.loops()) + " loop closure"));
      with_loops += path.loops() > 0;
      EXPECT_NEAR(candidate.change->trajectory, path.trajectory_change(), 1e-9);
    }
    const bool by_fallback = decision.why.find("; frontier: ") != std::string::npos;
    EXPECT_TRUE(by_fallback || std::ranges::is_sorted(decision.candidates, {}, &Candidate::value));
  };
  run_exploration(exploration);
  EXPECT_GT(with_loops, 5);
}

/// By default what is discovered counts the same on all paths of a decision; with `alpha=end` by
/// where each of them ends.
TEST_P(TreeExplorers, WeighTheMapByHowWellThePoseIsKnownNow) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 3).floor;
  for (const auto& [options, at_end] : {std::pair("", false), std::pair(",alpha=end", true)}) {
    ExplorationParts parts(kNoisyRobot, std::string(GetParam()) + ":density=2" + options);
    Exploration exploration = parts.on(floor);
    exploration.limits.decisions = 5;
    int compared = 0, differ = 0;
    exploration.decided = [&](const Decision& decision, const Situation& situation) {
      const JointObjective objective({.power = 1.0 / 3.0}, situation.map.frame.resolution,
                                     situation.robot.lidar.range);
      PathInformation information(situation, {}, [](const Pose2&, const Pose2&) { return true; });
      const double now = objective.alpha(information.start().covariance());
      for (const Candidate& candidate : decision.candidates) {
        if (!candidate.change) continue;
        ++compared;
        differ += std::abs(candidate.change->alpha - now) > 1e-9 * now;
      }
    };
    run_exploration(exploration);
    EXPECT_GT(compared, 10);
    EXPECT_EQ(differ > 0, at_end) << options;
  }
}

TEST_P(TreeExplorers, KnowWhichLoopClosuresThePolicyMakes) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 3).floor;
  for (const char* gain : {"0.5", "6"}) {
    ExplorationParts parts(kNoisyRobot, std::string(GetParam()) + ":density=1");
    parts.policy =
        parts.make<PosePolicy>(std::string("compact_pose:reuse=false,loop_gain=") + gain);
    Exploration exploration = parts.on(floor);
    exploration.limits.decisions = 2;
    int decisions = 0;
    exploration.decided = [&](const Decision&, const Situation& situation) {
      EXPECT_EQ(situation.match.loop_gain, std::stod(gain));
      ++decisions;
    };
    run_exploration(exploration);
    EXPECT_EQ(decisions, 2);
  }
}

TEST_P(TreeExplorers, TheSameSeedGivesTheSameRun) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 5).floor;
  const auto run = [&](std::uint64_t seed) {
    ExplorationParts parts(kNoisyRobot, std::string(GetParam()) + ":density=2");
    Exploration exploration = parts.on(floor, seed);
    exploration.limits.distance = 5.0;
    return run_exploration(exploration);
  };
  const ExplorationResult a = run(7), b = run(7), other = run(8);
  ASSERT_EQ(a.steps.size(), b.steps.size());
  for (std::size_t k = 0; k < a.steps.size(); ++k) {
    ASSERT_EQ(a.steps[k].estimate.x(), b.steps[k].estimate.x());
    ASSERT_EQ(a.steps[k].map_entropy, b.steps[k].map_entropy);
    ASSERT_EQ(a.steps[k].trajectory_entropy, b.steps[k].trajectory_entropy);
  }
  EXPECT_EQ(a.map.log_odds, b.map.log_odds);
  EXPECT_NE(a.steps.back().estimate.x(), other.steps.back().estimate.x());
}

TEST_P(TreeExplorers, EndWithAReasonWhereNothingIsToBeGained) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 5).floor;
  ExplorationParts parts(kExactRobot,
                         std::string(GetParam()) + ":fallback=none,density=1,least_gain=1e6");
  const ExplorationResult result = run_exploration(parts.on(floor));
  EXPECT_EQ(result.end, ExplorationEnd::stuck);  // it is not finished
  EXPECT_THAT(result.why, HasSubstr("lowers the entropy by 1e+06 nats/m"));
  EXPECT_THAT(result.why, HasSubstr("frontiers are left"));
  // With another explorer to fall back on it is that explorer that drives.
  ExplorationParts falling(kExactRobot, std::string(GetParam()) + ":density=1,least_gain=1e6");
  Exploration exploration = falling.on(floor);
  exploration.limits.decisions = 8;
  exploration.decided = [](const Decision& decision, const Situation&) {
    EXPECT_THAT(decision.why, HasSubstr("; frontier: to a frontier"));
    EXPECT_FALSE(decision.tree.empty());
  };
  EXPECT_GT(run_exploration(exploration).steps.back().distance, 0.5);
}

TEST_P(TreeExplorers, SayThatTheClockHasCutTheirTree) {
  const OccupancyGrid floor = test::known_floor("rooms:width=12,height=9", 5).floor;
  ExplorationParts parts(kExactRobot, std::string(GetParam()) + ":density=200");
  Exploration exploration = parts.on(floor);
  exploration.limits.decisions = 2;
  exploration.decision_budget = 0.05;
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_THAT(result.notes, testing::Contains(HasSubstr("time budget")));
  EXPECT_GT(result.steps.back().distance, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Both, TreeExplorers, testing::Values("drrt_star", "errt_star"));

class TreeExplorersOnFloors : public testing::TestWithParam<std::tuple<const char*, const char*>> {
};

TEST_P(TreeExplorersOnFloors, WithoutNoiseAllIsSeenAndNothingIsTouched) {
  const auto [explorer, plan] = GetParam();
  const OccupancyGrid floor = test::known_floor(plan, 3).floor;
  ExplorationParts parts(kExactRobot, std::string(explorer) + ":density=2");
  const ExplorationResult result = run_exploration(parts.on(floor));
  EXPECT_EQ(result.end, ExplorationEnd::finished) << result.why;
  EXPECT_EQ(result.collisions, 0);
  ASSERT_TRUE(result.against);
  EXPECT_GE(result.against->seen, 0.99 * result.against->floor);
}

INSTANTIATE_TEST_SUITE_P(Plans, TreeExplorersOnFloors,
                         testing::Combine(testing::Values("drrt_star", "errt_star"),
                                          testing::Values("rooms:width=9,height=7",
                                                          "cave:width=8,height=8")));

}  // namespace
}  // namespace cairn
