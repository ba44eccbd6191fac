// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/pose_chain.hpp"
#include "unit/plugins/registration/registrations.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

class Recorded : public Registrations {};

TEST_F(Recorded, AnswersEitherWayRoundWithWhatIsThereAndWithNothingElse) {
  simulate("sphere:turns=6,poses_per_turn=12");
  const auto recorded = make("recorded");
  std::map<Pair, int> factors;
  for (int f = 0; f < world.graph.factor_count(); ++f) {
    const auto v = world.graph.factor_variables(f);
    factors[std::minmax(world.graph.id(v[0]), world.graph.id(v[1]))] = f;
  }
  for (const Pair& pair : all_pairs(world.graph)) {
    const auto answer = recorded->match(pair.first, pair.second);
    const auto reverse = recorded->match(pair.second, pair.first);
    const auto wanted = factors.find(pair);
    ASSERT_THAT(answer, SizeIs(wanted == factors.end() ? 0 : 1));
    ASSERT_THAT(reverse, SizeIs(answer.size()));
    if (answer.empty()) continue;
    expect_same(answer.front(), world.graph.factor(wanted->second));
    expect_same(reverse.front(), answer.front());
    EXPECT_FALSE(was_false(*recorded, pair));
  }
  EXPECT_THAT(recorded->match(3, 3), IsEmpty());
  EXPECT_THAT(recorded->match(3, 1'000'000), IsEmpty());
}

TEST_F(Recorded, AnswersWithEachOfSeveralFactorsAsItStands) {
  simulate("ring:poses=40");
  Graph& graph = world.graph;
  const auto type = registry.factor_type("EDGE_SE2");
  const std::array<double, 6> information{1, 0, 0, 1, 0, 1};
  const int first =
      graph.add_factor(type, std::array{10, 30}, std::array{1.0, 2.0, 0.5}, information);
  const int second =
      graph.add_factor(type, std::array{30, 10}, std::array{-1.5, 0.0, -0.4}, information);
  for (const Pair& pair : {Pair{10, 30}, Pair{30, 10}}) {
    const auto answer = make("recorded")->match(pair.first, pair.second);
    ASSERT_THAT(answer, SizeIs(2));
    expect_same(answer[0], graph.factor(first));
    expect_same(answer[1], graph.factor(second));
    const auto made_up = make("recorded:false_rate=1")->match(pair.first, pair.second);
    ASSERT_THAT(made_up, SizeIs(1));
    EXPECT_THAT(made_up[0].variables, ElementsAre(10, 30));
  }
}

TEST_F(Recorded, TakesOnlyMotionsForMatches) {
  simulate("landmarks2d:poses=60");
  const auto recorded = make("recorded");
  int motions = 0, sights = 0;
  for (int f = 0; f < world.graph.factor_count(); ++f) {
    const auto v = world.graph.factor_variables(f);
    if (v.size() != 2) continue;
    const bool motion = world.graph.factor_type(f).is_relative();
    ++(motion ? motions : sights);
    EXPECT_EQ(!recorded->match(world.graph.id(v[0]), world.graph.id(v[1])).empty(), motion);
  }
  EXPECT_GT(motions, 0);
  EXPECT_GT(sights, 0);
}

TEST_F(Recorded, MatchesAPartOfThePairsFalsely) {
  for (const std::string spec : {"manhattan:poses=1500", "sphere:turns=30,poses_per_turn=30"}) {
    simulate(spec);
    const auto right = make("recorded"), mixed = make("recorded:false_rate=0.3,seed=8");
    Extent longest{0.0, 0.0};
    const std::vector<bool> closes_loop = loop_closures(world.graph);
    for (int f = 0; f < world.graph.factor_count(); ++f) {
      if (!closes_loop[f]) continue;
      const Extent loop = extent(world.graph.type(0), world.graph.measurement(f));
      longest = {std::max(longest.length, loop.length), std::max(longest.angle, loop.angle)};
    }
    std::int64_t matched = 0, wrong = 0;
    for (int f = 0; f < world.graph.factor_count(); ++f) {
      const auto v = world.graph.factor_variables(f);
      const Pair pair{world.graph.id(v[0]), world.graph.id(v[1])};
      const Factor wanted = right->match(pair.first, pair.second).front();
      const auto answer = mixed->match(pair.first, pair.second);
      ASSERT_THAT(answer, SizeIs(1));
      ++matched;
      EXPECT_EQ(answer.front().information, wanted.information);
      EXPECT_EQ(answer.front().variables, wanted.variables);
      EXPECT_EQ(answer.front().measurement != wanted.measurement, was_false(*mixed, pair));
      expect_same(mixed->match(pair.second, pair.first).front(), answer.front());
      if (!was_false(*mixed, pair)) continue;
      ++wrong;
      const Extent drawn = extent(world.graph.type(0), answer.front().measurement);
      EXPECT_LE(drawn.length, longest.length * (1.0 + 1e-12));
      EXPECT_LE(drawn.angle, longest.angle * (1.0 + 1e-12));
    }
    expect_share(wrong, matched, 0.3);
    EXPECT_FALSE(was_false(*mixed, {0, 1'000'000}));
  }
}

}  // namespace
}  // namespace cairn::test
