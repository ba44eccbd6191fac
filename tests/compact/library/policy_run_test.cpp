// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/policy_run.hpp"

#include <atomic>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/geometry/pose.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Key;
using ::testing::SizeIs;

class PolicyRunTest : public ::testing::Test {
 protected:
  Simulation simulate(const std::string& generator) {
    return registry_.make<Generator>(generator)->generate(registry_, 5);
  }
  PolicyData world(const std::string& generator) {
    Simulation made = simulate(generator);
    return policy_data(std::move(made.graph), std::move(made.truth));
  }
  Registry registry_;
};

const PolicyJob kEverything{parse_component("compact_pose:strategy=apal,range=8,angle=3.15")};

TEST_F(PolicyRunTest, DataCountTheLoopsAndKeepTheTruth) {
  Simulation made = simulate("manhattan:poses=60,streets=3");
  const int factors = made.graph.factor_count();
  const PolicyData data = policy_data(std::move(made.graph), std::move(made.truth));
  EXPECT_THAT(data.poses, SizeIs(60));
  EXPECT_EQ(data.loops, factors - 59);
  EXPECT_TRUE(data.truth_graph.has_value());
  EXPECT_THAT(*data.truth, SizeIs(60));
}

TEST_F(PolicyRunTest, ATruthThatLacksPosesIsGoodForTheTrajectoryOnly) {
  Simulation made = simulate("ring:poses=20");
  Simulation shorter = simulate("ring:poses=12");
  const PolicyData data = policy_data(std::move(made.graph), std::move(shorter.truth));
  EXPECT_FALSE(data.truth_graph.has_value());
  EXPECT_THAT(*data.truth, SizeIs(12));
}

/// Poses 0 to 4 on a line, without odometry from 1 to 2: a way by 3, and another, less certain,
/// by 4.
Graph with_a_gap(Registry& registry, bool with_way) {
  Graph graph;
  for (int k = 0; k < 5; ++k) {
    const double state[] = {k + 0.0, 0.0, 0.0};
    graph.add_variable(registry.variable_type("VERTEX_SE2"), k, state);
  }
  const auto add = [&](Id a, Id b, std::vector<double> z, double information) {
    graph.add({.type = registry.factor_type("EDGE_SE2"),
               .variables = {a, b},
               .measurement = std::move(z),
               .information = {information, 0, 0, information, 0, information}});
  };
  add(0, 1, {1, 0, 0}, 100);
  add(2, 3, {1, 0, 0}, 100);
  add(3, 4, {1, 0, 0.5}, 100);
  if (!with_way) return graph;
  add(3, 1, {-2, 0, 0.25}, 100);
  add(1, 4, {3, 0, 0}, 1);
  return graph;
}

TEST_F(PolicyRunTest, AGapInOdometryIsBridgedByTheMostCertainWay) {
  const PolicyData data = policy_data(with_a_gap(registry_, true), {}, {}, Gaps::bridge);
  ASSERT_THAT(data.gaps, SizeIs(1));
  EXPECT_EQ(data.gaps[0].before, 1);
  EXPECT_EQ(data.gaps[0].after, 2);
  EXPECT_EQ(data.gaps[0].measurements, 2);
  EXPECT_EQ(data.loops, 2);
  ASSERT_THAT(data.poses[2].odometry, ElementsAre(data.gaps[0].factor));
  const Factor bridge = data.recording.factor(data.gaps[0].factor);
  EXPECT_THAT(bridge.variables, ElementsAre(1, 2));
  // From 1 to 3 is (-2, 0, 0.25) backwards, from 3 to 2 (1, 0, 0) backwards.
  const double c = std::cos(0.25), s = std::sin(0.25);
  const std::vector<double> expected{2 * c - c, -2 * s + s, -0.25};
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(bridge.measurement[k], expected[k], 1e-12) << k;
  // The variance of the heading is the sum of two, a hundred times.
  Eigen::Matrix3d information;
  const auto& upper = bridge.information;
  information << upper[0], upper[1], upper[2], upper[1], upper[3], upper[4], upper[2], upper[4],
      upper[5];
  EXPECT_NEAR(information.inverse()(2, 2), 100.0 * 0.02, 1e-9);
  EXPECT_THAT(to_string(data.gaps), HasSubstr("no factor joins pose 1 to pose 2"));
  EXPECT_THAT(to_string(data.gaps), HasSubstr("2 other measurements"));
}

TEST_F(PolicyRunTest, AGapWithoutAWayOrNotToBeBridgedIsRefused) {
  EXPECT_THROW(policy_data(with_a_gap(registry_, false), {}, {}, Gaps::bridge), Error);
  EXPECT_THROW(policy_data(with_a_gap(registry_, true)), Error);
  // Poses before the first lead nowhere.
  EXPECT_TRUE(policy_data(with_a_gap(registry_, true), {}, 2, Gaps::bridge).gaps.empty());
}

TEST_F(PolicyRunTest, RunsWithARegistrationOfTheCaller) {
  const PolicyData data = world("manhattan:poses=60,streets=3");
  int asked = 0;
  FunctionRegistration none([&](Id, Id) {
    ++asked;
    return std::vector<Factor>();
  });
  const PolicySetting setting{.data = data, .registry = registry_};
  PolicyRun run({parse_component("compact_pose:range=8,angle=3.15"), "there is no such", &none},
                setting);
  run.run(data.poses.size(), "");
  EXPECT_GT(asked, 0);
  EXPECT_EQ(run.counts().proposed, asked);
  EXPECT_EQ(run.counts().registered, 0);
  EXPECT_EQ(run.finish(Recovery::distribute).trajectory.variable_count(), 60);
}

TEST_F(PolicyRunTest, RefusesWhatIsNoTrajectory) {
  Simulation made = simulate("bundle");
  EXPECT_THROW(policy_data(std::move(made.graph)), Error);
}

TEST_F(PolicyRunTest, RefusesLandmarksThatThePolicyDoesNotTakeBeforeTheWork) {
  const auto refusal = [&](const PolicyData& data, const std::string& policy, ErrorCode code) {
    const PolicySetting setting{.data = data, .registry = registry_};
    try {
      const PolicyRun run({parse_component(policy)}, setting);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      return std::string(error.what());
    }
    return std::string("it was taken");
  };
  Simulation made = simulate("landmarks2d:poses=60");
  Graph& graph = made.graph;
  int landmark = 0;
  while (!is_point(graph.type(landmark))) ++landmark;
  const std::string name = graph.describe_variable(landmark);
  const auto takes_none = testing::AllOf(HasSubstr("'random_poses' takes no landmarks"),
                                         HasSubstr(name), HasSubstr("use compact_pose"));
  EXPECT_THAT(refusal(policy_data(graph.clone()), "random_poses", ErrorCode::usage), takes_none);
  graph.set_fixed(landmark);
  const PolicyData fixed = policy_data(std::move(graph));
  EXPECT_THAT(refusal(fixed, "compact_pose", ErrorCode::input),
              testing::AllOf(HasSubstr(name), HasSubstr("remove its FIX")));
  // Not what to do about the FIX of a landmark that is refused in any case.
  EXPECT_THAT(refusal(fixed, "random_poses", ErrorCode::usage), takes_none);
}

TEST_F(PolicyRunTest, CountsLandmarksAndEachMeasurementOfThem) {
  Simulation made = simulate("landmarks2d:poses=60");
  Graph& graph = made.graph;
  const int factors = graph.factor_count();
  int doubled = 0;
  for (int f = 0; f < factors && doubled < 5; ++f) {  // another measurement of the same
    const Factor factor = graph.factor(f);
    if (factor.type->is_relative()) continue;
    graph.add(factor);
    ++doubled;
  }
  const PolicyData data = policy_data(std::move(made.graph));
  EXPECT_EQ(doubled, 5);
  const PolicySetting setting{.data = data, .registry = registry_};
  PolicyRun run(kEverything, setting);
  run.run(60, "all");
  const PolicyResult result = run.finish(Recovery::distribute);
  EXPECT_EQ(result.kept_observations, data.observations);
  EXPECT_EQ(result.kept_landmarks, data.landmarks);
  EXPECT_EQ(result.compact.factor_count(), data.recording.factor_count());
  EXPECT_EQ(result.kept_poses, 60);
}

TEST_F(PolicyRunTest, CountsWhatBecameOfEveryPoseAndLoop) {
  const PolicyData data = world("manhattan:poses=80,streets=3");
  const PolicySetting setting{.data = data, .registry = registry_};
  PolicyRun run(kEverything, setting);
  std::vector<std::size_t> after;
  run.run(80, "all", [&](std::size_t index) { after.push_back(index); });
  const PolicyResult result = run.finish(Recovery::distribute);
  ASSERT_THAT(after, SizeIs(80));
  EXPECT_EQ(after.back(), 79U);
  EXPECT_THAT(result.poses, SizeIs(80));
  EXPECT_EQ(result.compact.variable_count(), 80);
  EXPECT_EQ(result.trajectory.variable_count(), 80);
  EXPECT_FALSE(result.interrupted);
  EXPECT_GT(result.kept_loops, 0);
  EXPECT_LE(result.kept_loops, result.registered);
  EXPECT_LE(result.registered, result.proposed);
  EXPECT_EQ(result.verdicts.at("linked"), result.kept_loops);
  std::int64_t verdicts = 0;
  for (const auto& [name, count] : result.verdicts) verdicts += count;
  EXPECT_EQ(verdicts, result.proposed);
  EXPECT_EQ(result.compact.factor_count(), 79 + result.kept_loops);
  // Each 3 × 3 block of the diagonal, and two for each pair that is joined.
  EXPECT_EQ(result.information_nonzeros % 9, 0);
  EXPECT_GE(result.factor_nonzeros, result.information_nonzeros / 2);
}

TEST_F(PolicyRunTest, WithTheTruthErrorsAreKnownForEveryRecovery) {
  const PolicyData data = world("ring:poses=40,noise=0");
  const PolicySetting setting{.data = data, .registry = registry_};
  PolicyRun run(kEverything, setting);
  run.run(40, "");
  const PolicyResult result = run.finish(Recovery::likely);
  EXPECT_THAT(result.errors, ElementsAre(Key("likely"), Key("v0"), Key("v1"), Key("v2")));
  for (const auto& [name, error] : result.errors) EXPECT_LT(error.ate_translation, 1e-6) << name;
  ASSERT_TRUE(result.normalized.has_value());
  EXPECT_EQ(result.normalized->dof, 39 * 3);
  EXPECT_NEAR(result.normalized->squared, 0.0, 1e-9);
}

TEST_F(PolicyRunTest, WithoutTheTruthThereAreNoErrors) {
  Simulation made = simulate("ring:poses=20");
  const PolicyData data = policy_data(std::move(made.graph));
  const PolicySetting setting{.data = data, .registry = registry_};
  PolicyRun run(kEverything, setting);
  run.run(20, "");
  const PolicyResult result = run.finish(Recovery::distribute);
  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_FALSE(result.normalized.has_value());
}

TEST_F(PolicyRunTest, ReportsProgressAndStopsWhenInterrupted) {
  const PolicyData data = world("ring:poses=30");
  std::atomic<bool> interrupt = false;
  std::vector<std::string> titles;
  const PolicySetting setting{
      .data = data,
      .registry = registry_,
      .interrupt = &interrupt,
      .progress = [&](std::string_view title, std::size_t poses, const PolicyResult& counts) {
        titles.emplace_back(title);
        EXPECT_EQ(poses, 25U);
        EXPECT_EQ(counts.poses.size(), titles.size());
        if (titles.size() == 10) interrupt = true;
      }};
  PolicyRun run(kEverything, setting);
  run.run(25, "sample");
  EXPECT_THAT(titles, SizeIs(10));
  EXPECT_THAT(titles, Each("sample"));
  const PolicyResult result = run.finish(Recovery::distribute);
  EXPECT_TRUE(result.interrupted);
  EXPECT_EQ(result.trajectory.variable_count(), 10);
}

TEST_F(PolicyRunTest, CountsFalseMatches) {
  const PolicyData data = world("manhattan:poses=150,streets=4");
  const PolicySetting setting{.data = data, .registry = registry_};
  PolicyRun run({kEverything.policy, "simulated:range=6,angle=3.14,false_rate=0.5"}, setting);
  run.run(150, "");
  EXPECT_GT(run.counts().false_registered, 0);
  EXPECT_LT(run.counts().false_registered, run.counts().registered);
  EXPECT_LE(run.counts().false_kept, run.counts().false_registered);
}

TEST(SpecText, NamesTheComponentAndItsOptions) {
  EXPECT_EQ(spec_text({"compact_pose", {}}), "compact_pose");
  EXPECT_EQ(spec_text({"compact_pose", {{"range", "5"}, {"angle", "0.5"}}}),
            "compact_pose:angle=0.5,range=5");
}

}  // namespace
}  // namespace cairn
