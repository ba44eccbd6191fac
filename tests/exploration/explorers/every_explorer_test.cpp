// SPDX-License-Identifier: BSD-3-Clause
// What holds of every explorer on offer: its runs end, say why, and don't drive to and fro.
#include <algorithm>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/exploration.hpp"
#include "cairn/plugin/registry.hpp"
#include "exploration/support/exploration_runs.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

/// The longest way in a row on which neither a cell became known nor a loop was closed [m].
double longest_without_progress(const std::vector<ExplorationStep>& steps) {
  double longest = 0.0, since = 0.0, most_known = 0.0;
  int loops = 0;
  for (const ExplorationStep& step : steps) {
    if (step.coverage > most_known || step.loops > loops) since = step.distance;
    most_known = std::max(most_known, step.coverage);
    loops = std::max(loops, step.loops);
    longest = std::max(longest, step.distance - since);
  }
  return longest;
}

constexpr double kLooping = 50.0;  // [m]

/// Drives back and forth between two places for ever.
class Pendulum final : public Explorer {
 public:
  void begin(std::uint64_t) override {}
  Decision decide(const Situation& situation) override {
    Decision decision;
    const Eigen::Vector2d at = situation.pose.translation();
    const double side = situation.decision % 2 == 0 ? 1.0 : -1.0;
    decision.candidates.push_back({{.points = {at, at + Eigen::Vector2d(side, 0.0)}}, 0.0, ""});
    return decision;
  }
};

/// The measure of the tests below finds what it is for.
TEST(EveryExplorer, OneThatLoopsIsFoundOut) {
  const OccupancyGrid floor = test::floor_named("rooms:width=9,height=7", 1);
  test::ExplorationParts parts(test::kExactRobot);
  parts.explorer = std::make_unique<Pendulum>();
  Exploration exploration = parts.on(floor);
  exploration.limits.distance = 80.0;
  exploration.limits.idle_distance = std::numeric_limits<double>::infinity();
  const ExplorationResult result = run_exploration(exploration);
  EXPECT_EQ(result.end, ExplorationEnd::limit);
  EXPECT_GT(longest_without_progress(result.steps), kLooping);
}

struct Case {
  std::string explorer, floor;
  friend std::ostream& operator<<(std::ostream& out, const Case& of) {
    return out << of.explorer << " on " << of.floor;
  }
};

/// All that are on offer, those that take long with less to search.
std::vector<Case> cases() {
  std::vector<Case> all;
  for (std::string name : Registry().names(Explorer::kKind)) {
    if (name == "ede_gradient") name += ":orientations=24";
    if (name.ends_with("rrt_star") && !name.starts_with("ede")) name += ":density=3";
    for (const char* floor : {"rooms:width=9,height=7", "cave:width=9,height=9"})
      all.push_back({name, floor});
  }
  return all;
}

class EveryExplorerOnAFloor : public testing::TestWithParam<Case> {};

TEST_P(EveryExplorerOnAFloor, EndsWithAReasonAndDoesNotLoop) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const OccupancyGrid floor = test::floor_named(GetParam().floor, seed);
    test::ExplorationParts parts(test::kNoisyRobot, GetParam().explorer);
    Exploration exploration = parts.on(floor, seed);
    exploration.limits.distance = 60.0;
    const ExplorationResult result = run_exploration(exploration);
    EXPECT_FALSE(result.why.empty());
    EXPECT_NE(result.end, ExplorationEnd::interrupted);
    EXPECT_LE(longest_without_progress(result.steps), kLooping) << result.why;
    // None is so bad that it misses half of two rooms or a cave.
    ASSERT_TRUE(result.against);
    EXPECT_GT(result.against->seen, 0.5 * result.against->floor) << result.why;
  }
}

INSTANTIATE_TEST_SUITE_P(OnOffer, EveryExplorerOnAFloor, testing::ValuesIn(cases()));

}  // namespace
}  // namespace cairn
