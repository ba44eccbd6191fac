// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "compact/registration/registrations.hpp"

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

// Carrying ----------------------------------------------------------------------------------------

/// A recording of 30 poses in a line, with one loop closure, from pose 5 to pose 20.
class CarriedLoop : public Registrations {
 protected:
  void SetUp() override {
    const auto pose = registry.variable_type("VERTEX_SE2");
    const auto relative = registry.factor_type("EDGE_SE2");
    const std::array<double, 6> information{400, 0, 0, 400, 0, 2500};
    Graph& graph = world.graph;
    for (int k = 0; k < 30; ++k)
      graph.add_variable(pose, k, std::array{static_cast<double>(k), 0.0, 0.0});
    for (int k = 0; k + 1 < 30; ++k)
      graph.add_factor(relative, std::array{k, k + 1}, std::array{1.0, 0.2, 0.1}, information);
    graph.add_factor(relative, std::array{5, 20}, std::array{0.5, -0.3, 2.0}, information);
  }
  std::unique_ptr<Registration> recorded(const std::string& options,
                                         const std::vector<Id>& left_out) {
    auto made = registry.make<Registration>("recorded" + options);
    made->begin({.recording = &world.graph});
    for (const Id id : left_out) made->pose_ended(id, false);
    return made;
  }
  /// Composed by hand along poses, with the covariance of the sum; that of odometry counts twice.
  Motion along(const std::vector<Id>& poses) const {
    const MotionGroup group(registry_pose_);
    Motion all = group.identity();
    for (std::size_t k = 0; k + 1 < poses.size(); ++k) {
      for (int f = 0; f < world.graph.factor_count(); ++f) {
        const Factor factor = world.graph.factor(f);
        if (std::minmax(factor.variables[0], factor.variables[1]) ==
            std::minmax(poses[k], poses[k + 1]))
          all = group.compose(all,
                              doubled(group.of_factor(factor, poses[k]), poses[k], poses[k + 1]));
      }
    }
    return all;
  }
  static Motion doubled(Motion motion, Id from, Id to) {
    if (std::abs(from - to) == 1) {
      for (double& entry : motion.covariance) entry *= 2.0;
    }
    return motion;
  }
  void expect_way(const std::vector<Factor>& answer, const std::vector<Id>& poses) {
    ASSERT_THAT(answer, SizeIs(1));
    const MotionGroup group(registry_pose_);
    const Motion motion = group.of_factor(answer.front(), poses.front()), expected = along(poses);
    for (std::size_t k = 0; k < expected.mean.size(); ++k)
      EXPECT_NEAR(motion.mean[k], expected.mean[k], 1e-12);
    for (std::size_t k = 0; k < expected.covariance.size(); ++k)
      EXPECT_NEAR(motion.covariance[k], expected.covariance[k], 1e-9);
  }
  const std::shared_ptr<const VariableType> registry_pose_ = registry.variable_type("VERTEX_SE2");
};

TEST_F(CarriedLoop, OfAPoseThatWasNotKeptIsMeasuredByWayOfIt) {
  expect_way(recorded("", {5})->match(3, 20), {3, 4, 5, 20});
  expect_way(recorded("", {5})->match(7, 20), {7, 6, 5, 20});
  expect_way(recorded("", {20, 21})->match(5, 22), {5, 20, 21, 22});
  expect_way(recorded("", {5, 20, 21})->match(4, 22), {4, 5, 20, 21, 22});
}

TEST_F(CarriedLoop, IsNotWhereItsOwnPosesCouldBeAskedFor) {
  EXPECT_THAT(recorded("", {})->match(3, 20), IsEmpty());       // pose 5 is kept
  EXPECT_THAT(recorded("", {5})->match(3, 22), IsEmpty());      // so is pose 20
  EXPECT_THAT(recorded("", {5, 20})->match(3, 19), IsEmpty());  // which is still to come
}

TEST_F(CarriedLoop, IsGivenOnce) {
  const auto registration = recorded("", {5});
  EXPECT_THAT(registration->match(4, 20), SizeIs(1));
  EXPECT_THAT(registration->match(6, 20), IsEmpty());
  const auto asked = recorded("", {20});
  EXPECT_THAT(asked->match(5, 20), SizeIs(1));  // itself
  EXPECT_THAT(asked->match(5, 21), IsEmpty());
}

TEST_F(CarriedLoop, GoesNoFartherThanTheOptionSays) {
  EXPECT_THAT(recorded(":carry=2", {5})->match(3, 20), SizeIs(1));
  EXPECT_THAT(recorded(":carry=1", {5})->match(3, 20), IsEmpty());
  EXPECT_THAT(recorded(":carry=3", {5, 20, 21})->match(4, 22), SizeIs(1));
  EXPECT_THAT(recorded(":carry=2", {5, 20, 21})->match(4, 22), IsEmpty());
  EXPECT_THAT(recorded(":carry=0", {5})->match(4, 20), IsEmpty());
}

TEST_F(CarriedLoop, MayBeFalseAsAnyOther) {
  const auto registration = recorded(":false_rate=1", {5});
  EXPECT_THAT(registration->match(4, 20), SizeIs(1));
  EXPECT_TRUE(was_false(*registration, {4, 20}));
  EXPECT_FALSE(was_false(*registration, {3, 20}));
}

}  // namespace
}  // namespace cairn::test
