// SPDX-License-Identifier: BSD-3-Clause
#include "compact_pose.hpp"

#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "compact/compact_pose/robot.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using test::all_ids;
using test::difference;
using test::Draw;
using test::planar_types;
using test::PolicyRun;
using test::PoseWorld;
using test::run;
using test::simulate;
using test::spatial_types;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Key;
using testing::SizeIs;
using Pose = PoseWorld::Pose;
using Pair = std::pair<Id, Id>;

TEST_F(CompactPoseTest, AllPosesAndAllLoopsAreTheWholeGraph) {
  for (const char* generator :
       {"manhattan:poses=150,streets=4", "sphere:turns=5,poses_per_turn=12"}) {
    Simulation world = simulate(registry, generator);
    const PolicyRun all =
        run(registry, world, "compact_pose:strategy=apal,search=untested", "recorded");
    EXPECT_EQ(all.kept(), all_ids(world.graph));
    const Graph graph = all.policy->estimator().graph();
    EXPECT_EQ(graph.variable_count(), world.graph.variable_count());
    EXPECT_EQ(graph.factor_count(), world.graph.factor_count());
    const Summary summary = registry.make<Optimizer>("levenberg_marquardt")->optimize(world.graph);
    EXPECT_NEAR(all.policy->estimator().chi2(), summary.final_chi2, 1e-6 * summary.final_chi2);
    for (const OdometryChain& chain : all.policy->chains()) EXPECT_THAT(chain.steps, SizeIs(1));
  }
}

TEST_F(CompactPoseTest, EachStrategyTakesFewerThanTheOneBefore) {
  const Simulation world = simulate(registry, "manhattan:poses=250,streets=5");
  std::vector<std::size_t> poses, links;
  for (const std::string strategy : {"apal", "apfl", "fpfl"}) {
    const PolicyRun one =
        run(registry, world, "compact_pose:range=3,angle=3.15,reuse=true,strategy=" + strategy,
            "simulated:range=3");
    poses.push_back(one.kept().size());
    links.push_back(one.links().size());
  }
  EXPECT_EQ(poses[0], 250U);
  EXPECT_EQ(poses[1], 250U);
  EXPECT_LT(poses[2], 200U);
  EXPECT_GT(poses[2], 20U);
  EXPECT_GT(links[0], 2 * links[1]);
  EXPECT_GT(links[2], 10U);
}

TEST_F(CompactPoseTest, TheWayIsInTheChainsAndEveryPoseOnce) {
  for (const char* generator :
       {"manhattan:poses=250,streets=5", "sphere:turns=6,poses_per_turn=16"}) {
    const Simulation world = simulate(registry, generator);
    const PolicyRun few = run(
        registry, world, "compact_pose:reuse=false,range=20,angle=3.15,pose_gain=4", "recorded");
    std::vector<Id> ids{few.policy->chains().front().from};
    Id last = ids.back();
    for (const OdometryChain& chain : few.policy->chains()) {
      EXPECT_EQ(chain.from, last);
      for (const ChainStep& step : chain.steps) ids.push_back(step.pose);
      last = chain.to;
      EXPECT_EQ(ids.back(), last);
    }
    EXPECT_EQ(ids, all_ids(world.graph));
    EXPECT_LT(few.policy->chains().size(), ids.size() - 20);
    EXPECT_EQ(few.policy->estimator().variable_count(),
              static_cast<int>(few.policy->chains().size()) + 1);
  }
}

TEST_F(CompactPoseTest, WithoutThresholdsTakesThoseOfALinkAsGoodAsTheOdometry) {
  struct Case {
    std::string generator;
    double freedoms;
  };
  for (const auto& [generator, n] : {Case{"manhattan:poses=200,streets=5", 3.0},
                                     Case{"sphere:turns=6,poses_per_turn=16,radius=6", 6.0}}) {
    const Simulation world = simulate(registry, generator);
    const auto power = [n = n](double p) {
      return std::to_string(std::pow(0.5 * n * std::log(2.0) + 1.0, p) - 1.0);
    };
    const std::string policy = "compact_pose:reuse=false,range=4,angle=3.15";
    const PolicyRun given =
        run(registry, world, policy + ",loop_gain=" + power(1.36) + ",pose_gain=" + power(1.7),
            "recorded");
    const PolicyRun left = run(registry, world, policy, "recorded");
    EXPECT_EQ(given.kept(), left.kept());
    EXPECT_EQ(given.links(), left.links());
    for (const std::string& other : {",loop_gain=" + power(1.6), ",pose_gain=" + power(1.9)}) {
      const PolicyRun changed = run(registry, world, policy + other, "recorded");
      EXPECT_TRUE(changed.kept() != left.kept() || changed.links() != left.links()) << other;
    }
  }
}

TEST_F(CompactPoseTest, ConcatenatesToTheOrderThatIsChosen) {
  const PoseWorld world(spatial_types(registry));
  Draw draw(1);
  const Pose z = world.random(draw, 1.0, 1.0);
  const MatrixXd Sigma = draw.covariance(6, 0.3);
  for (const auto order : {CompositionOrder::first, CompositionOrder::fourth}) {
    const auto policy =
        make(std::string("composition=") + (order == CompositionOrder::first ? "first" : "fourth") +
             ",range=1e6,angle=3.15,probability=0,pose_gain=1e9");
    policy->add_pose(world.variable(0, world.identity()), {});
    Motion expected = world.motion(z, Sigma);
    for (Id id = 0; id < 5; ++id) {
      policy->end_pose();
      const Factor moved = world.edge(id, id + 1, z, Sigma);
      policy->add_pose(world.variable(id + 1), {&moved, 1});
      if (id > 0) expected = world.motions().compose(expected, world.motion(z, Sigma), order);
    }
    policy->end_pose();
    policy->finish();
    const Graph graph = policy->estimator().graph();
    ASSERT_EQ(graph.factor_count(), 1);
    const Motion taken =
        world.motions().of_factor(*world.types().edge, graph.measurement(0), graph.information(0));
    EXPECT_LT(difference(to_matrix(taken.covariance, 6), to_matrix(expected.covariance, 6)), 1e-9);
  }
}

TEST_F(CompactPoseTest, WhereNothingIsNearAPoseIsKept) {
  Robot robot(registry, "range=0.1,angle=3.15");
  for (int k = 0; k < 10; ++k) EXPECT_TRUE(robot.advance().kept);
}

TEST_F(CompactPoseTest, FixedPosesAreKept) {
  Simulation world = simulate(registry, "manhattan:poses=60,streets=3,noise=0.1");
  for (const Id id : {17, 18, 40}) world.graph.set_fixed(*world.graph.find(id));
  for (const Id id : {17, 18, 40})
    world.graph.set_state(*world.graph.find(id), world.truth.state(*world.truth.find(id)));
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  const PolicyRun few =
      run(make("range=1e6,angle=3.15,probability=0,pose_gain=1e9"), none, world.graph);
  EXPECT_THAT(few.kept(), ElementsAre(0, 17, 18, 40));
  std::vector<Id> variables;
  const Graph graph = few.policy->estimator().graph();
  for (int v = 0; v < graph.variable_count(); ++v) {
    variables.push_back(graph.id(v));
    if (graph.id(v) < 17 || graph.id(v) > 40) continue;
    EXPECT_TRUE(graph.fixed(v));
    EXPECT_THAT(graph.state(v),
                testing::Pointwise(testing::DoubleNear(1e-12),
                                   world.truth.state(*world.truth.find(graph.id(v)))));
  }
  EXPECT_THAT(variables, ElementsAre(0, 17, 18, 40, 59));
}

TEST_F(CompactPoseTest, TheNewestStateIsOdometryFromTheLastKeptPose) {
  const PoseWorld world(planar_types(registry));
  const auto policy = make("range=1e6,angle=3.15,probability=0,pose_gain=1e9");
  Draw draw(1);
  Pose x = world.random(draw, 2.0, 1.0);
  policy->add_pose(world.variable(0, x), {});
  for (Id id = 0; id < 20; ++id) {
    policy->end_pose();
    const Pose z = world.random(draw, 2.0, 1.0);
    const Factor moved = world.edge(id, id + 1, z, MatrixXd::Identity(3, 3));
    policy->add_pose(world.variable(id + 1), {&moved, 1});
    x = world.compose(x, z);
    EXPECT_LT(world.log(world.between(x, policy->newest_state())).norm(), 1e-12);
  }
  EXPECT_THAT(policy->chains(), IsEmpty());
}

TEST_F(CompactPoseTest, FindsThresholdsThatLoseNoLoopOfTheSample) {
  const Simulation world = simulate(registry, "manhattan:poses=250,streets=5");
  auto policy = make("range=1,angle=0.1,probability=0.1");
  auto* finder = query<OptionFinder>(*policy);
  ASSERT_NE(finder, nullptr);
  EXPECT_THAT(message_of([&] { finder->found(); }, ErrorCode::input), HasSubstr("no loop"));
  OptionValues watching = finder->watching(false);
  watching["probability"] = "0.1";
  const auto registration = registry.make<Registration>("simulated:range=2.5,angle=1");
  registration->begin({.recording = &world.graph, .truth = &world.truth});
  const PolicyRun sample = run(registry.make<PosePolicy>(ComponentSpec{"compact_pose", watching}),
                               *registration, world.graph);
  EXPECT_EQ(sample.kept().size(), 250U);
  const OptionValues found = query<OptionFinder>(*sample.policy)->found();
  // Loops are found out to 2.5 m and 1 rad, and the sensor is as good as the odometry.
  const double range = std::stod(found.at("range")), angle = std::stod(found.at("angle"));
  EXPECT_GT(range, 1.9);
  EXPECT_LT(range, 4.0);
  EXPECT_LT(angle, 1.1);
  EXPECT_THAT(found, Contains(Key("sensor")));

  // With all poses and all loops, the same are found again.
  OptionValues chosen = found;
  chosen["strategy"] = "apal";
  const PolicyRun again = run(registry.make<PosePolicy>(ComponentSpec{"compact_pose", chosen}),
                              *registration, world.graph);
  const auto linked = sample.links();
  EXPECT_EQ(std::set<Pair>(linked.begin(), linked.end()).size(), linked.size());
  const auto found_again = again.links();
  EXPECT_GT(found_again.size(), 50U);
  EXPECT_EQ(std::set<Pair>(linked.begin(), linked.end()),
            std::set<Pair>(found_again.begin(), found_again.end()));
}

/// What thresholds are found from takes memory for every loop closure: nobody asks a policy that
/// runs with thresholds for others.
TEST_F(CompactPoseTest, RemembersLoopsForThresholdsOnlyWhereItWatches) {
  const Simulation world = simulate(registry, "manhattan:poses=250,streets=5");
  const PolicyRun live =
      run(registry, world, "compact_pose:range=3,angle=3.15", "simulated:range=3");
  EXPECT_GT(live.links().size(), 10U);
  EXPECT_THAT(message_of([&] { query<OptionFinder>(*live.policy)->found(); }, ErrorCode::input),
              HasSubstr("no loop closure"));
}

/// Of a recording, where the others do not match: the same, without the gain of every pair.
TEST_F(CompactPoseTest, OnlyThePairsOfARecordingNeedToBeAskedFor) {
  for (const char* generator :
       {"manhattan:poses=250,streets=5", "sphere:turns=6,poses_per_turn=16,radius=6"}) {
    const Simulation world = simulate(registry, generator);
    const PolicyRun all =
        run(registry, world, "compact_pose:strategy=apal,search=untested", "recorded");
    const PolicyRun recorded =
        run(registry, world, "compact_pose:strategy=apal,search=recorded", "recorded");
    EXPECT_GT(recorded.links().size(), 50U);
    EXPECT_EQ(recorded.links(), all.links());
    EXPECT_THAT(recorded.links(LinkVerdict::unmatched), IsEmpty());
    ASSERT_EQ(recorded.reports.size(), all.reports.size());
    for (std::size_t k = 1; k < all.reports.size(); ++k) {
      const PoseReport &a = all.reports[k], &b = recorded.reports[k];
      ASSERT_NEAR(a.least_gain, b.least_gain, 1e-9 * (1.0 + a.least_gain)) << k;
      ASSERT_LE(b.candidates, a.candidates);
    }
    const OptionValues expected = query<OptionFinder>(*all.policy)->found();
    const OptionValues found = query<OptionFinder>(*recorded.policy)->found();
    for (const char* name : {"range", "angle", "loop_gain", "pose_gain"}) {
      const double value = std::stod(expected.at(name));
      EXPECT_NEAR(std::stod(found.at(name)), value, 1e-6 * value) << name;
    }
    EXPECT_EQ(found.at("sensor"), expected.at("sensor"));
  }
}

TEST_F(CompactPoseTest, PairsOfARecordingNeedOne) {
  EXPECT_THAT(message_of([&] { Robot(registry, "search=recorded"); }, ErrorCode::usage),
              HasSubstr("is for a recording"));
}

}  // namespace
}  // namespace cairn::compact
