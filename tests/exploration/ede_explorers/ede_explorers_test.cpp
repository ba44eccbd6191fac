// SPDX-License-Identifier: BSD-3-Clause
// Explorers by the entropy decrease, on generated floors.
#include <algorithm>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/exploration.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/support/exploration_runs.hpp"

namespace cairn {
namespace {

using testing::HasSubstr;

using test::DecidedRun;
using test::kExactRobot;
using test::kNoisyRobot;

/// With few orientations, for a test.
constexpr const char* kGradient = "ede_gradient:orientations=16,directions=120";

struct Floor {
  const char* plan;
  const char* explorer;

  friend void PrintTo(const Floor& floor, std::ostream* out) {
    *out << floor.plan << " " << floor.explorer;
  }
};

class EdeFloors : public testing::TestWithParam<Floor> {};

TEST_P(EdeFloors, WithoutNoiseAllIsSeenAndNothingIsTouched) {
  const DecidedRun found =
      test::explore(GetParam().plan, kExactRobot, GetParam().explorer, {.distance = 150.0});
  EXPECT_EQ(found.result.end, ExplorationEnd::finished) << found.result.why;
  EXPECT_EQ(found.result.collisions, 0);
  ASSERT_TRUE(found.result.against);
  EXPECT_GE(found.result.against->seen, 0.98 * found.result.against->floor);
}

INSTANTIATE_TEST_SUITE_P(Plans, EdeFloors,
                         testing::Values(Floor{"rooms:width=12,height=9", "ede_rrt_star"},
                                         Floor{"corridor:width=20,height=10", "ede_rrt_star"},
                                         Floor{"loop:width=16,height=12", "ede_rrt_star"},
                                         Floor{"cave:width=12,height=12", "ede_rrt_star"},
                                         Floor{"rooms:width=9,height=7", kGradient}));

TEST(EdeExplorers, DecideForTheLeastEntropy) {
  const DecidedRun found =
      test::explore("rooms:width=12,height=9", kNoisyRobot, "ede_rrt_star", {.distance = 25.0});
  ASSERT_GE(found.decisions.size(), 3U);
  for (const Decision& decision : found.decisions) {
    if (decision.kind != Decision::Kind::drive) continue;
    for (const Candidate& candidate : decision.candidates) {
      ASSERT_TRUE(candidate.change);
      const InformationChange& change = *candidate.change;
      EXPECT_NEAR(candidate.value, change.trajectory + change.alpha * change.map,
                  1e-9 * std::abs(candidate.value));
      EXPECT_LE(decision.candidates[decision.chosen].value, candidate.value);
      EXPECT_LT(candidate.value, 0.0);
      ASSERT_TRUE(candidate.path.look_at);
    }
    EXPECT_THAT(decision.why, HasSubstr("frontier cells in sight"));
  }
}

TEST(EdeExplorers, PerMetreDividesByTheLengthOfThePath) {
  const DecidedRun found =
      test::explore("rooms:width=12,height=9", kNoisyRobot,
                    "ede_rrt_star:per_metre=true,planner=grid_dijkstra", {.distance = 10.0});
  int compared = 0;
  for (const Decision& decision : found.decisions) {
    for (const Candidate& candidate : decision.candidates) {
      const InformationChange& change = *candidate.change;
      const double length = (change.trajectory + change.alpha * change.map) / candidate.value;
      if (candidate.path.length < 1.0) continue;
      // Over the cells of the grid it is a little longer.
      EXPECT_NEAR(length, candidate.path.length, 0.5 + 0.15 * candidate.path.length);
      ++compared;
    }
  }
  EXPECT_GT(compared, 5);
}

TEST(EdeExplorers, TheSameSeedGivesTheSameRun) {
  for (const char* explorer : {"ede_rrt_star", kGradient}) {
    const DecidedRun a =
        test::explore("rooms:width=9,height=7", kNoisyRobot, explorer, {.distance = 12.0});
    const DecidedRun b =
        test::explore("rooms:width=9,height=7", kNoisyRobot, explorer, {.distance = 12.0});
    ASSERT_EQ(a.result.steps.size(), b.result.steps.size());
    for (std::size_t k = 0; k < a.result.steps.size(); ++k) {
      EXPECT_EQ(a.result.steps[k].estimate.x(), b.result.steps[k].estimate.x());
      EXPECT_EQ(a.result.steps[k].map_entropy, b.result.steps[k].map_entropy);
    }
    ASSERT_EQ(a.decisions.size(), b.decisions.size());
    for (std::size_t k = 0; k < a.decisions.size(); ++k)
      EXPECT_EQ(a.decisions[k].why, b.decisions[k].why);
    EXPECT_EQ(a.result.map.log_odds, b.result.map.log_odds);
  }
}

/// A potential of one sweep is flat but for where a single configuration attracts.
TEST(EdeExplorers, AGradientThatLeadsNowhereIsStuckOrGoesOnByItsFallback) {
  const std::string unsolved = "ede_gradient:orientations=8,directions=120,sweeps=1,weight=3";
  const DecidedRun alone =
      test::explore("rooms:width=12,height=9", kNoisyRobot, unsolved + ",attractor=1,fallback=none",
                    {.distance = 60.0});
  const DecidedRun with = test::explore("rooms:width=12,height=9", kNoisyRobot,
                                        unsolved + ",attractor=1", {.distance = 15.0});
  ASSERT_EQ(alone.result.end, ExplorationEnd::stuck) << alone.result.why;
  EXPECT_THAT(alone.result.why, HasSubstr("the gradient leads nowhere (1 of "));
  EXPECT_GT(with.result.steps.size(), 10U);
  EXPECT_TRUE(std::ranges::any_of(with.decisions, [](const Decision& decision) {
    return decision.why.find("; fallback: to ") != std::string::npos;
  }));
}

TEST(EdeExplorers, WhereNothingIsLeftTheFallbackGoesOn) {
  // Frontiers of 100 m alone count: there are none from the beginning.
  const DecidedRun ends = test::explore("rooms:width=12,height=9", kNoisyRobot,
                                        "ede_rrt_star:smallest=100", {.distance = 20.0});
  EXPECT_EQ(ends.result.end, ExplorationEnd::finished);
  EXPECT_EQ(ends.result.why, "no frontier of 100 m or more is in sight of where it can drive");
  EXPECT_EQ(ends.decisions.size(), 1U);
  const DecidedRun goes_on =
      test::explore("rooms:width=12,height=9", kNoisyRobot,
                    "ede_rrt_star:smallest=100,fallback=frontier", {.distance = 20.0});
  EXPECT_EQ(goes_on.result.end, ExplorationEnd::limit);
  EXPECT_THAT(goes_on.decisions.front().why, HasSubstr("a frontier of"));
}

class EdeWithoutTime : public testing::TestWithParam<const char*> {};

/// With a budget that is over before anything is computed, each decision is the one that is known
/// at once; nothing of it depends on the clock.
TEST_P(EdeWithoutTime, TheyGoOnByWhatIsKnownAtOnce) {
  const OccupancyGrid floor = test::floor_named("rooms:width=9,height=7", 3);
  test::ExplorationParts parts(kExactRobot, GetParam());
  Exploration exploration = parts.on(floor);
  exploration.decision_budget = 1e-9;
  exploration.limits.distance = 150.0;
  int paths = 0;
  exploration.decided = [&](const Decision& decision, const Situation& situation) {
    if (decision.kind != Decision::Kind::drive) return;
    const PlannedPath& path = decision.candidates[decision.chosen].path;
    ASSERT_GE(path.points.size(), 2U);
    double length = 0.0;
    for (std::size_t k = 1; k < path.points.size(); ++k)
      length += (path.points[k] - path.points[k - 1]).norm();
    EXPECT_NEAR(path.length, length, 1e-9);
    EXPECT_EQ(path.points.front(), situation.pose.translation());
    paths += decision.why.find("by the shortest path") != std::string::npos;
  };
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.end, ExplorationEnd::finished) << result.why;
  EXPECT_EQ(result.collisions, 0);
  ASSERT_TRUE(result.against);
  EXPECT_GE(result.against->seen, 0.98 * result.against->floor);
  if (std::string(GetParam()).starts_with("ede_gradient")) {
    EXPECT_GT(paths, 3);
    EXPECT_THAT(result.notes, testing::Contains(HasSubstr("time budget")));
  }
}

INSTANTIATE_TEST_SUITE_P(Both, EdeWithoutTime,
                         testing::Values("ede_rrt_star:planner=grid_dijkstra", kGradient));

TEST(EdeExplorers, RefuseWhatMakesNoSense) {
  const auto refusal = [](const std::string& name) -> std::string {
    try {
      Registry().make<Explorer>(parse_component(name));
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_THAT(refusal("ede_gradient:fallback=ede_gradient"), HasSubstr("another explorer"));
  EXPECT_THAT(refusal("ede_rrt_star:fallback=ede_rrt_star"), HasSubstr("another explorer"));
  EXPECT_THAT(refusal("ede_rrt_star:fallback=nearest"), HasSubstr("nearest"));
  EXPECT_THAT(refusal("ede_rrt_star:orientations=1"), HasSubstr("orientations"));
}

}  // namespace
}  // namespace cairn
