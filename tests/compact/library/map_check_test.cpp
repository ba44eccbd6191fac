// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/map_check.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/io/generator.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

class MapCheckOf : public ::testing::Test {
 protected:
  void SetUp() override {
    Simulation world = registry_.make<Generator>("manhattan:poses=200")->generate(registry_, 3);
    data_ = policy_data(std::move(world.graph));
  }
  PolicyResult run(const std::string& policy) {
    PolicyRun run({.policy = parse_component(policy)}, setting_);
    run.run(data_.poses.size(), "run");
    return run.finish(Recovery::distribute);
  }

  PolicyJob job_{.policy = {}};  // what it is checked by: its registration
  Registry registry_;
  PolicyData data_;
  PolicySetting setting_{.data = data_, .registry = registry_};
};

TEST_F(MapCheckOf, EverythingIsNowhereFar) {
  const auto check =
      check_map(job_, run("compact_pose:strategy=apal,range=100,angle=3.15"), setting_);
  ASSERT_TRUE(check);
  EXPECT_LT(check->distance, 1e-6);
  EXPECT_FALSE(check->is_far());
}

/// Without a loop closure the map is dead reckoning; the other map is that of another program path.
TEST_F(MapCheckOf, OdometryAloneIsItsDistance) {
  const PolicyResult alone = run("compact_pose:loop_gain=1e6,pose_gain=0");
  ASSERT_EQ(alone.kept_loops, 0);
  const auto check = check_map(job_, alone, setting_);
  ASSERT_TRUE(check);
  const PolicyResult all = run("compact_pose:strategy=apal,range=100,angle=3.15");
  EXPECT_NEAR(check->distance,
              absolute_error(trajectory(alone.trajectory), trajectory(all.trajectory)), 1e-6);
  EXPECT_GT(check->distance, 0.05);
  EXPECT_GT(check->extent, 10.0 * check->distance);
  EXPECT_THAT(check->to_string(), HasSubstr(" m from the map of all measurements, "));
  EXPECT_EQ(check->is_far(), check->distance > 0.005 * check->extent);
}

/// The factors by which `graph` has more than a world without wrong loop closures: the generator
/// adds these to the same measurements.
std::vector<int> planted(const Graph& graph, const Graph& right) {
  std::vector<int> wrong;
  int next = 0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const bool there = next < right.factor_count() &&
                       std::ranges::equal(graph.measurement(f), right.measurement(next));
    next += there;
    if (!there) wrong.push_back(f);
  }
  return wrong;
}

class WrongLoops : public MapCheckOf, public ::testing::WithParamInterface<std::string> {
 protected:
  Graph world(int wrong) {
    const std::string outliers = wrong > 0 ? ",outliers=" + std::to_string(wrong) : "";
    return registry_.make<Generator>(GetParam() + outliers)->generate(registry_, 3).graph;
  }
};

TEST_P(WrongLoops, AreLeftOutAllOfThemAndNoOther) {
  const Graph right = world(0);
  for (const int wrong : {0, 1, 10, 40}) {
    Graph graph = world(wrong);
    const std::vector<int> expected = planted(graph, right);
    ASSERT_THAT(expected, SizeIs(wrong));
    data_ = policy_data(std::move(graph));
    const EstimateOfAll all = estimate_of_all(setting_);
    EXPECT_EQ(all.why_not, "");
    EXPECT_EQ(all.left_out, expected) << wrong;
    EXPECT_EQ(all.graph.factor_count(), right.factor_count());
    EXPECT_EQ(left_out_in_words(all, data_).empty(), wrong == 0);
    const PolicyData rest = without_contradictions(std::move(data_), all);
    EXPECT_EQ(rest.loops, policy_data(right.clone()).loops);
    EXPECT_EQ(rest.recording.factor_count(), right.factor_count());
  }
}

/// Beside covariances that are too large a wrong loop closure bends the map at little cost, and
/// chi2 stays below what chance allows.
TEST_P(WrongLoops, AreLeftOutWhereCovariancesAreTooLarge) {
  for (const double times : {0.1, 1e-3, 1e-5}) {
    const auto with_less = [&](const Graph& from) {
      Graph graph = from.clone();
      for (int f = 0; f < graph.factor_count(); ++f) {
        Factor factor = from.factor(f);
        for (double& entry : factor.information) entry *= times;
        graph.set_measurement(f, factor.measurement, factor.information);
      }
      return graph;
    };
    const Graph right = world(0);
    for (const int wrong : {0, 1, 3}) {
      const Graph graph = world(wrong);
      data_ = policy_data(with_less(graph));
      const EstimateOfAll all = estimate_of_all(setting_);
      EXPECT_EQ(all.why_not, "");
      EXPECT_EQ(all.left_out, planted(graph, right)) << times << " " << wrong;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, WrongLoops,
                         ::testing::Values("manhattan:poses=200", "ellipse3d:poses=100"));

/// A single step of odometry is wrong where it contradicts many loop closures, and no gap is left.
TEST_F(MapCheckOf, AWrongStepOfOdometryIsLeftOutInsteadOfLoopClosures) {
  const int step = data_.poses[150].odometry.front();
  std::vector<double> z(data_.recording.measurement(step).begin(),
                        data_.recording.measurement(step).end());
  z[0] += 2.0;
  Graph graph = data_.recording.clone();
  graph.set_measurement(step, z, {});
  data_ = policy_data(std::move(graph));
  const EstimateOfAll all = estimate_of_all(setting_);
  EXPECT_EQ(all.left_out, std::vector<int>{step});
  EXPECT_EQ(all.loops_left_out, 0);
  EXPECT_THAT(left_out_in_words(all, data_), HasSubstr("1 of 462 measurements contradict"));
  const std::int64_t loops = data_.loops;
  const PolicyData rest = without_contradictions(std::move(data_), all);
  EXPECT_EQ(rest.loops, loops);
  ASSERT_THAT(rest.gaps, SizeIs(1));
  EXPECT_EQ(rest.gaps[0].after, 150);
}

/// Where loops are sparse a right one seems to be wrong beside a wrong one, and comes back.
TEST_F(MapCheckOf, NoRightLoopIsLeftOutBesideAWrongOne) {
  for (const std::uint64_t seed : {4, 6, 8}) {
    const auto world = [&](const char* wrong) {
      const std::string name = "city:poses=500,loop_density=0.05,loops_per_pose=1";
      return registry_.make<Generator>(name + wrong)->generate(registry_, seed).graph;
    };
    const Graph right = world(""), graph = world(",outliers=2");
    data_ = policy_data(graph.clone());
    EXPECT_EQ(estimate_of_all(setting_).left_out, planted(graph, right)) << seed;
  }
}

/// Where most are wrong, there is no saying which.
TEST_F(MapCheckOf, ThereIsNoEstimateWhereMostLoopsAreWrong) {
  Simulation world =
      registry_.make<Generator>("manhattan:poses=200,outliers=400")->generate(registry_, 3);
  data_ = policy_data(std::move(world.graph));
  const EstimateOfAll all = estimate_of_all(setting_);
  EXPECT_THAT(all.why_not, HasSubstr("measurements contradict each other"));
  EXPECT_TRUE(all.left_out.empty());
  EXPECT_FALSE(check_map(job_, run("compact_pose:range=100,angle=3.15,loop_gain=1e6,pose_gain=0"),
                         setting_));
}

/// Losses of one's own say which measurements count.
TEST_F(MapCheckOf, WithLossesOfTheirOwnNoneAreLeftOut) {
  Simulation world =
      registry_.make<Generator>("manhattan:poses=200,outliers=10")->generate(registry_, 3);
  data_ = policy_data(std::move(world.graph));
  setting_.loss = registry_.make<Loss>("cauchy");
  setting_.loss_on = FactorSelector::loops();
  EXPECT_TRUE(estimate_of_all(setting_).left_out.empty());
}

TEST_F(MapCheckOf, NothingIsCheckedOfAnInterruptedRunOrOtherMatches) {
  PolicyResult result = run("compact_pose:range=5");
  EXPECT_TRUE(check_map({.policy = {}, .registration = "recorded:carry=0"}, result, setting_));
  EXPECT_FALSE(check_map({.policy = {}, .registration = "simulated:range=5"}, result, setting_));
  result.interrupted = true;
  EXPECT_FALSE(check_map(job_, result, setting_));
}

}  // namespace
}  // namespace cairn
