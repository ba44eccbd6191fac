// SPDX-License-Identifier: BSD-3-Clause
// Explorers that compare a few paths by the information that they bring, on generated floors.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
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

using testing::AnyOf;
using testing::HasSubstr;

using test::DecidedRun;
using test::kExactRobot;

constexpr const char* kNoisy = "lidar_building:relative=0.1,sigma_theta=0.01";

/// The longest that it has driven without more of the floor being known, by 0.2 % [m].
double longest_without_progress(const ExplorationResult& result) {
  double most = 0.0, since = 0.0, longest = 0.0;
  for (const ExplorationStep& step : result.steps) {
    if (step.coverage > 1.002 * most) {
      most = step.coverage;
      since = step.distance;
    }
    longest = std::max(longest, step.distance - since);
  }
  return longest;
}

class InformationExplorers : public testing::TestWithParam<std::tuple<const char*, const char*>> {};

TEST_P(InformationExplorers, WithoutNoiseAllIsSeen) {
  const auto [explorer, plan] = GetParam();
  const DecidedRun found = test::explore(plan, kExactRobot, explorer, {});
  EXPECT_EQ(found.result.end, ExplorationEnd::finished) << found.result.why;
  EXPECT_THAT(found.result.why, HasSubstr("is left"));
  // On the way to a far frontier it may touch the frame of a door that it has not seen whole.
  EXPECT_LE(found.result.collisions, 2);
  ASSERT_TRUE(found.result.against);
  EXPECT_GE(found.result.against->seen, 0.99 * found.result.against->floor);
}

TEST_P(InformationExplorers, WithNoiseEachRunEndsWithAReasonAndMakesProgress) {
  const auto [explorer, plan] = GetParam();
  for (const std::uint64_t seed : {4, 5}) {
    const DecidedRun found = test::explore(plan, kNoisy, explorer, {.distance = 80.0}, seed);
    EXPECT_THAT(found.result.why,
                AnyOf(HasSubstr("is left"), HasSubstr("80 m are driven"), HasSubstr("50 m were")));
    EXPECT_LT(longest_without_progress(found.result), 51.0);
    ASSERT_TRUE(found.result.against);
    const double seen = found.result.against->seen / found.result.against->floor;
    // What it is stuck with are gaps that errors of the map have left.
    EXPECT_GE(seen, found.result.end == ExplorationEnd::stuck ? 0.98 : 0.8) << found.result.why;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Floors, InformationExplorers,
    testing::Combine(testing::Values("heuristic", "dopt", "dopt:by=laplacian"),
                     testing::Values("rooms:width=12,height=9", "corridor:width=20,height=10",
                                     "loop:width=16,height=12", "cave:width=12,height=12")));

void expect_the_same_run_twice(const char* explorer) {
  const DecidedRun a =
      test::explore("loop:width=16,height=12", kNoisy, explorer, {.distance = 20.0});
  const DecidedRun b =
      test::explore("loop:width=16,height=12", kNoisy, explorer, {.distance = 20.0});
  ASSERT_EQ(a.result.steps.size(), b.result.steps.size());
  for (std::size_t k = 0; k < a.result.steps.size(); ++k) {
    ASSERT_EQ(a.result.steps[k].estimate.x(), b.result.steps[k].estimate.x());
    ASSERT_EQ(a.result.steps[k].trajectory_entropy, b.result.steps[k].trajectory_entropy);
  }
  ASSERT_EQ(a.decisions.size(), b.decisions.size());
  for (std::size_t k = 0; k < a.decisions.size(); ++k)
    EXPECT_EQ(a.decisions[k].why, b.decisions[k].why);
}

TEST(Heuristic, TheSameSeedGivesTheSameRun) { expect_the_same_run_twice("heuristic"); }

TEST(Heuristic, DrivesWhatLowersBothEntropiesMostAndSaysTheValues) {
  const DecidedRun found = test::explore("loop:width=16,height=12", kNoisy,
                                         "heuristic:loop_gain=0.5", {.distance = 50.0});
  ASSERT_GE(found.decisions.size(), 5U);
  std::size_t revisits = 0;
  for (const Decision& decision : found.decisions) {
    if (decision.kind != Decision::Kind::drive) continue;
    ASSERT_LE(decision.candidates.size(), 3U);
    const Candidate& chosen = decision.candidates.at(decision.chosen);
    for (const Candidate& candidate : decision.candidates) {
      ASSERT_TRUE(candidate.change);
      EXPECT_EQ(candidate.change->alpha, 1.0);
      EXPECT_DOUBLE_EQ(candidate.value, candidate.change->trajectory + candidate.change->map);
      EXPECT_LE(chosen.value, candidate.value);
      EXPECT_LE(candidate.change->map, 0.0);
      EXPECT_THAT(decision.why, HasSubstr(candidate.what));
      revisits += candidate.what.starts_with("pose ");
    }
    EXPECT_THAT(decision.why, HasSubstr("trajectory"));
  }
  EXPECT_GT(revisits, 0U);
}

/// With so much noise, and no worth of the map, a revisit is best whenever there is one.
TEST(Heuristic, GivesUpRevisitsThatDiscoverNothing) {
  const std::string lost = "lidar_building:relative=0.3,sigma_theta=0.03";
  const std::string home = "heuristic:simulated_range=0.1,loop_gain=0.1,homing=true";
  const auto longest_row = [](const DecidedRun& drive) {
    int row = 0, longest = 0;
    for (const Decision& decision : drive.decisions) {
      if (decision.kind != Decision::Kind::drive) continue;
      const bool revisits = !decision.candidates[decision.chosen].what.starts_with("a frontier");
      row = revisits ? row + 1 : 0;
      longest = std::max(longest, row);
    }
    return longest;
  };
  const ExplorationLimits limits{.distance = 60.0, .decisions = 150};
  const DecidedRun any =
      test::explore("loop:width=16,height=12", lost, home + ",revisits=0", limits);
  const DecidedRun one =
      test::explore("loop:width=16,height=12", lost, home + ",revisits=1", limits);
  EXPECT_GT(longest_row(any), 2);
  EXPECT_NE(one.result.end, ExplorationEnd::stuck) << one.result.why;
  EXPECT_GT(one.result.steps.back().coverage, any.result.steps.back().coverage);
  const bool went_home = std::ranges::any_of(any.decisions, [](const Decision& decision) {
    return std::ranges::any_of(decision.candidates, [](const Candidate& candidate) {
      return candidate.what == "the first pose";
    });
  });
  EXPECT_TRUE(went_home);
}

/// By the threshold of the policy, unless another one is given; the thesis's form of the entropy is
/// twice the information gain.
TEST(Heuristic, RevisitsPosesWhoseLoopClosureThePolicyWouldMake) {
  const std::string lost = "lidar_building:relative=0.3,sigma_theta=0.03";
  const double gain = MatchModel().loop_gain;
  for (const auto& [options, least] :
       {std::pair(std::string(), gain), {",entropy=thesis", 2.0 * gain}}) {
    const DecidedRun found =
        test::explore("loop:width=16,height=12", lost, "heuristic:simulated_range=0.1" + options,
                      {.distance = 60.0, .decisions = 60});
    int revisits = 0;
    for (const Decision& decision : found.decisions) {
      for (const Candidate& candidate : decision.candidates) {
        double nats = 0.0;
        unsigned long pose = 0;
        if (std::sscanf(candidate.what.c_str(), "pose %lu, with a loop closure of %lf", &pose,
                        &nats) != 2)
          continue;
        ++revisits;
        EXPECT_GE(nats, least - 0.05) << candidate.what;  // as rounded
      }
    }
    EXPECT_GT(revisits, 0);
  }
}

TEST(Dopt, TheSameSeedGivesTheSameRun) {
  expect_the_same_run_twice("dopt");
  expect_the_same_run_twice("dopt:by=laplacian");
}

TEST(Dopt, DrivesToTheFrontierWithTheLargestOneAndSaysSo) {
  for (const std::string by : {"exact", "laplacian"}) {
    const DecidedRun found =
        test::explore("loop:width=16,height=12", kNoisy, "dopt:by=" + by, {.distance = 50.0});
    ASSERT_GE(found.decisions.size(), 5U);
    std::size_t not_nearest = 0;
    for (const Decision& decision : found.decisions) {
      if (decision.kind != Decision::Kind::drive) continue;
      const Candidate& chosen = decision.candidates.at(decision.chosen);
      for (const Candidate& candidate : decision.candidates) {
        EXPECT_LE(chosen.value, candidate.value);
        not_nearest += candidate.path.length < chosen.path.length;
        EXPECT_THAT(candidate.what, HasSubstr("a frontier of"));
      }
      EXPECT_THAT(decision.why, HasSubstr("D-optimality (" + by + ")"));
    }
    EXPECT_GT(not_nearest, 0U);
  }
}

/// With a margin that everything is within it drives as `frontier` does, but for what that keeps.
TEST(Dopt, WithinTheMarginTheNearestIsChosen) {
  const DecidedRun wide = test::explore("rooms:width=12,height=9", kNoisy,
                                        "dopt:margin=1000,keep=1", {.distance = 20.0});
  const DecidedRun nearest =
      test::explore("rooms:width=12,height=9", kNoisy, "frontier:keep=1", {.distance = 20.0});
  ASSERT_EQ(wide.result.steps.size(), nearest.result.steps.size());
  EXPECT_EQ(wide.result.steps.back().estimate.x(), nearest.result.steps.back().estimate.x());
}

TEST(Dopt, NeedsALinearSolverWithDeterminants) {
  Registry registry;
  EXPECT_THROW(registry.make<Explorer>(parse_component("dopt:solver=none")), Error);
}

}  // namespace
}  // namespace cairn
