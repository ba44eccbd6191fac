// SPDX-License-Identifier: BSD-3-Clause
// Which links are proposed, taken, and left to wait for another that agrees.
#include <array>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "cairn/runtime/error.hpp"
#include "compact/compact_pose/robot.hpp"
#include "compact/support/policy_runs.hpp"
#include "compact_pose.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::difference;
using test::Draw;
using test::planar_types;
using test::PolicyRun;
using test::PoseWorld;
using test::run;
using test::simulate;
using testing::HasSubstr;
using testing::SizeIs;
using Pose = PoseWorld::Pose;

TEST_F(CompactPoseTest, ProposesWhatTellsMostAndDoesNotProposeItAgain) {
  Robot robot(registry, "strategy=apfl,range=30,angle=3.15,loop_gain=0.2");
  for (int k = 0; k < 30; ++k) robot.advance();
  double last = std::numeric_limits<double>::infinity();
  std::set<Id> proposed;
  while (const auto match = robot.policy().next_match()) {
    EXPECT_EQ(match->later, robot.newest());
    EXPECT_LT(match->earlier, robot.newest() - 1);
    EXPECT_LE(match->gain, last);
    last = match->gain;
    EXPECT_TRUE(proposed.insert(match->earlier).second);
    const VectorXd off = robot.world().log(
        robot.world().between(match->expected.mean, robot.right(match->earlier).measurement));
    const MatrixXd S = Eigen::Map<const MatrixXd>(match->expected.covariance.data(), 3, 3);
    EXPECT_LT(off.dot((S + 4e-4 * MatrixXd::Identity(3, 3)).llt().solve(off)), 30.0);
    const LinkReport report = robot.policy().offer(match->earlier, {});
    EXPECT_EQ(report.verdict, LinkVerdict::unmatched);
    EXPECT_EQ(report.expected_gain, match->gain);
  }
  EXPECT_GT(proposed.size(), 10U);
  const PoseReport report = robot.policy().end_pose();
  EXPECT_FALSE(report.closed_loop);
  EXPECT_THAT(report.links, SizeIs(proposed.size()));
}

TEST_F(CompactPoseTest, TakesOrLeavesWhatItDidNotAskFor) {
  for (const bool near : {true, false}) {
    Robot robot(registry, near ? "strategy=apfl,range=100,angle=3.15" : "strategy=apfl,range=0.5");
    for (int k = 0; k < 40; ++k) robot.advance();
    // Far out of range if that is 0.5 m.
    const LinkReport taken = robot.offer(robot.right(3));
    EXPECT_EQ(taken.verdict, LinkVerdict::linked);
    EXPECT_GT(taken.gain, 3.0);
    EXPECT_LT(robot.newest_error(), 0.5);
    // The same once more tells nothing new, or nearly.
    const LinkReport again = robot.offer(robot.right(3, 0.05));
    EXPECT_EQ(again.verdict, LinkVerdict::uninformative);
    EXPECT_LT(again.gain, 1.0);
    EXPECT_EQ(robot.policy().offer(4, {}).verdict, LinkVerdict::unmatched);
    // Nobody is asked about it any more.
    while (const auto match = robot.policy().next_match()) {
      EXPECT_NE(match->earlier, 3);
      EXPECT_NE(match->earlier, 4);
      robot.policy().offer(match->earlier, {});
    }
    const PoseReport report = robot.policy().end_pose();
    EXPECT_TRUE(report.kept && report.closed_loop);
  }
}

// Far out of range: its covariance was never asked for, and it is from some poses ago.
TEST_F(CompactPoseTest, KnowsWhatALinkTellsWhereverItComesFrom) {
  std::vector<double> gains;
  for (const std::string options : {"range=0.5", "range=1000,angle=3.15"}) {
    Robot robot(registry, "strategy=apfl,loop_gain=0.3," + options);
    gains.clear();
    for (int k = 0; k < 120; ++k) {
      robot.advance();
      if (k % 10 == 9) {
        for (const Id other : {Id{5}, Id{2}, robot.newest() / 2}) {
          const LinkReport report = robot.offer(robot.right(other));
          gains.push_back(report.gain);
          gains.push_back(report.innovation);
        }
      }
    }
    static std::vector<double> first;
    if (first.empty()) first = gains;
    EXPECT_THAT(gains, testing::Pointwise(testing::DoubleNear(1e-6), first));
  }
}

TEST_F(CompactPoseTest, ALinkKeepsItsPose) {
  Robot robot(registry, "range=1e6,angle=3.15,probability=0,pose_gain=1e9");
  for (int k = 0; k < 30; ++k) robot.advance();
  EXPECT_EQ(robot.offer(robot.right(0)).verdict, LinkVerdict::linked);
  EXPECT_TRUE(robot.policy().end_pose().kept);
  ASSERT_THAT(robot.policy().chains(), SizeIs(1));
  EXPECT_THAT(robot.policy().chains().front().steps, SizeIs(30));
  EXPECT_THAT(message_of([&] { robot.policy().offer(15, {}); }, ErrorCode::usage),
              HasSubstr("without a pose"));
}

TEST_F(CompactPoseTest, EdgesMayPointBackwards) {
  const Simulation world = simulate(registry, "manhattan:poses=200,streets=4");
  const PoseWorld poses(planar_types(registry));
  Graph backwards;
  for (int v = 0; v < world.graph.variable_count(); ++v)
    backwards.add_variable(poses.types().pose, world.graph.id(v), world.graph.state(v));
  for (int f = 0; f < world.graph.factor_count(); ++f) {
    const Factor factor = world.graph.factor(f);
    const Id from = factor.variables[0], to = factor.variables[1];
    const Factor turned =
        poses.motions().to_factor(factor.type, to, from, poses.motions().of_factor(factor, to));
    backwards.add_factor(turned.type, std::array{*backwards.find(to), *backwards.find(from)},
                         turned.measurement, turned.information);
  }
  const std::string policy = "compact_pose:reuse=false,range=3,angle=3.15";
  const auto registration = registry.make<Registration>("recorded:carry=0");
  registration->begin({.recording = &world.graph});
  const PolicyRun one = run(registry.make<PosePolicy>(policy), *registration, world.graph);
  const auto turned = registry.make<Registration>("recorded:carry=0");
  turned->begin({.recording = &backwards});
  const PolicyRun other = run(registry.make<PosePolicy>(policy), *turned, backwards);
  EXPECT_EQ(one.kept(), other.kept());
  EXPECT_EQ(one.links(), other.links());
  EXPECT_GT(one.links().size(), 5U);
  EXPECT_LT(one.kept().size(), 190U);
  const Graph a = one.policy->estimator().graph(), b = other.policy->estimator().graph();
  double most = 0.0;  // not nothing: EDGE_SE2's error is no logarithm, and so has a direction
  for (int v = 0; v < a.variable_count(); ++v)
    most = std::max(most, poses.log(poses.between(a.state(v), b.state(v))).norm());
  EXPECT_LT(most, 0.01);
}

/// The newest pose is offered false matches with others, all off by the same motion.
class InVain : public CompactPoseTest {
 protected:
  Robot driven(const std::string& options) {
    Robot robot(registry, "range=30,angle=3.15,loop_gain=0.2,gate=0.999," + options);
    for (int k = 0; k < 30; ++k) robot.advance();
    return robot;
  }
  LinkVerdict offer_false_one(Robot& robot, Id other) {
    const Pose off{7.0, -4.0, 1.0};
    return robot
        .offer(robot.wrong(other, robot.world().compose(robot.right(other).measurement, off)))
        .verdict;
  }
  /// How many matches are proposed, if all are false but that of number `right`.
  int proposed(Robot& robot, int right = -1) {
    int count = 0;
    for (; const auto match = robot.policy().next_match(); ++count) {
      if (count == right)
        EXPECT_EQ(robot.offer(robot.right(match->earlier)).verdict, LinkVerdict::linked);
      else
        EXPECT_EQ(offer_false_one(robot, match->earlier), LinkVerdict::inconsistent);
    }
    return count;
  }
};

TEST_F(InVain, AfterSeveralMatchesNoOtherIsProposed) {
  Robot robot = driven("strategy=apfl,attempts=3");
  EXPECT_EQ(proposed(robot), 3);
  EXPECT_EQ(robot.advance().links.size(), 3U);
  EXPECT_EQ(proposed(robot, 2), 6);  // counted again from the link on
  robot.advance();
  EXPECT_EQ(proposed(robot), 3);
}

TEST_F(InVain, AnyNumberIsProposedWhereItIsAskedFor) {
  for (const char* options : {"strategy=apfl,attempts=0", "strategy=apal,attempts=3"}) {
    Robot robot = driven(options);
    EXPECT_GT(proposed(robot), 10) << options;
  }
}

TEST_F(InVain, WhatNobodyAskedForDoesNotCount) {
  Robot robot = driven("strategy=apfl,attempts=3");
  for (Id other = 1; other <= 5; ++other)
    EXPECT_EQ(offer_false_one(robot, other), LinkVerdict::inconsistent);
  EXPECT_EQ(proposed(robot), 3);
}

/// The one that was false may have been what the others contradicted.
TEST_F(InVain, AfterALinkWasRevokedOthersAreProposedAgain) {
  Robot robot = driven("strategy=apfl,attempts=3");
  const auto match = robot.policy().next_match();
  ASSERT_TRUE(match);
  ASSERT_EQ(robot.offer(robot.right(match->earlier)).verdict, LinkVerdict::linked);
  EXPECT_EQ(proposed(robot), 3);
  EXPECT_TRUE(robot.policy().revoke(match->earlier, robot.newest()));
  EXPECT_EQ(proposed(robot), 3);
}

TEST_F(CompactPoseTest, SeveralMeasurementsOfOneMotionCountAsOne) {
  const PoseWorld world(planar_types(registry));
  const auto policy = make("range=1e6,angle=3.15,probability=0,pose_gain=1e9");
  policy->add_pose(world.variable(0, world.identity()), {});
  policy->end_pose();
  Draw draw(1);
  const MatrixXd S_1 = draw.covariance(3, 0.1), S_2 = draw.covariance(3, 0.2);
  const Pose z_1{1.0, 0.1, 0.2}, z_2{1.05, 0.05, 0.25};
  const Motion fused = world.motions().fuse(world.motion(z_1, S_1), world.motion(z_2, S_2));
  const Factor both[] = {
      world.edge(0, 1, z_1, S_1),
      world.motions().to_factor(world.types().edge, 1, 0,
                                world.motions().inverse(world.motion(z_2, S_2)))};
  policy->add_pose(world.variable(1), both);
  EXPECT_LT(world.log(world.between(policy->newest_state(), fused.mean)).norm(), 1e-9);
  policy->end_pose();
  policy->finish();
  ASSERT_EQ(policy->estimator().factor_count(), 1);
  const Graph graph = policy->estimator().graph();
  const Motion taken =
      world.motions().of_factor(*world.types().edge, graph.measurement(0), graph.information(0));
  EXPECT_LT(difference(to_matrix(taken.covariance, 3), to_matrix(fused.covariance, 3)), 1e-9);
}

// Once around: the way back is known to a metre or so, and a false match may well fit.
class FarFromKnown : public CompactPoseTest {
 protected:
  Robot driven(int steps, unsigned seed) {
    Robot robot(registry, "strategy=apfl,range=5,angle=3.15,loop_gain=0.5,gate=0.999,trust=0.01",
                seed);
    for (int k = 0; k < steps; ++k) robot.advance();
    return robot;
  }
  static constexpr int kLap = 126;  // steps of 0.1 rad: twice around
};

TEST_F(FarFromKnown, ALinkWaitsForASecondThatAgrees) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Robot robot = driven(kLap, seed);
    const LinkReport first = robot.offer(robot.right(2));
    ASSERT_EQ(first.verdict, LinkVerdict::waiting);
    EXPECT_GT(first.gain, 1.0);
    EXPECT_FALSE(robot.advance().closed_loop);
    robot.advance();
    const LinkReport second = robot.offer(robot.right(4));
    EXPECT_EQ(second.verdict, LinkVerdict::linked);
    const PoseReport report = robot.policy().end_pose();
    ASSERT_THAT(report.links, SizeIs(2));
    EXPECT_EQ(report.links[1].earlier, 2);
    EXPECT_EQ(report.links[1].later, first.later);
    EXPECT_NE(report.links[1].verdict, LinkVerdict::waiting);
    EXPECT_NE(report.links[1].verdict, LinkVerdict::inconsistent);
    EXPECT_TRUE(report.closed_loop);
    EXPECT_LT(robot.newest_error(), 0.4);
  }
}

TEST_F(FarFromKnown, AFalseLinkDoesNotFreeTheOneThatWaits) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Robot robot = driven(kLap, seed);
    ASSERT_EQ(robot.offer(robot.right(2)).verdict, LinkVerdict::waiting);
    robot.advance();
    const Pose off = robot.world().compose(robot.right(3).measurement, Pose{-0.7, 0.9, 0.15});
    EXPECT_THAT(robot.offer(robot.wrong(3, off)).verdict,
                testing::AnyOf(LinkVerdict::waiting, LinkVerdict::inconsistent));
    EXPECT_FALSE(robot.advance().closed_loop);
    // The next right one agrees with the first; then it is known that the second is false.
    EXPECT_EQ(robot.offer(robot.right(4)).verdict, LinkVerdict::linked);
    const PoseReport report = robot.policy().end_pose();
    for (const LinkReport& link : report.links) {
      if (link.earlier == 3) {
        EXPECT_EQ(link.verdict, LinkVerdict::inconsistent);
      }
    }
    EXPECT_LT(robot.newest_error(), 0.4);
  }
}

TEST_F(FarFromKnown, WithoutAGateTheFirstIsTaken) {
  Robot robot(registry, "strategy=apfl,range=5,angle=3.15,loop_gain=0.5");
  for (int k = 0; k < kLap; ++k) robot.advance();
  EXPECT_EQ(robot.offer(robot.wrong(2, Pose{3.0, 3.0, 1.0})).verdict, LinkVerdict::linked);
}

TEST_F(FarFromKnown, WhatIsFarOffIsInconsistentAtOnce) {
  Robot robot = driven(10, 1);
  const LinkReport report = robot.offer(robot.wrong(2, Pose{0.0, 0.0, 3.0}));
  EXPECT_EQ(report.verdict, LinkVerdict::inconsistent);
  EXPECT_GT(report.innovation, 100.0);
  EXPECT_FALSE(robot.policy().end_pose().closed_loop);
}

}  // namespace
}  // namespace cairn::compact
