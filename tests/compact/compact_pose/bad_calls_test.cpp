// SPDX-License-Identifier: BSD-3-Clause
// What the compact pose policy refuses, and that it goes on afterwards.
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "compact/compact_pose/robot.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using test::planar_types;
using test::PoseWorld;
using testing::HasSubstr;

TEST_F(CompactPoseTest, GoesOnAfterABadCallAsIfItHadNotBeen) {
  Robot disturbed(registry, "range=20,angle=3.15,pose_gain=2", 3),
      quiet(registry, "range=20,angle=3.15,pose_gain=2", 3);
  PosePolicy& policy = disturbed.policy();
  const PoseWorld& world = disturbed.world();
  const MatrixXd I = MatrixXd::Identity(3, 3);
  const auto refuse = [&](const Variable& pose, const std::vector<Factor>& odometry) {
    return message_of([&] { policy.add_pose(pose, odometry); }, ErrorCode::input);
  };
  for (int k = 0; k < 60; ++k) {
    const Id n = disturbed.newest();
    EXPECT_THAT(message_of([&] { policy.add_pose(world.variable(n + 1), {}); }, ErrorCode::usage),
                HasSubstr("ended"));
    EXPECT_THROW(policy.finish(), Error);
    EXPECT_THAT(message_of([&] { policy.offer(1'000, {}); }, ErrorCode::input),
                HasSubstr("1000 is not in the compact graph"));
    EXPECT_THROW(policy.offer(n, {}), Error);  // the newest
    if (n > 0) {
      const Factor elsewhere = world.edge(0, n + 7, world.identity(), I);
      message_of([&] { policy.offer(0, {&elsewhere, 1}); }, ErrorCode::input);
      const Factor unequal{world.types().edge, {0, n}, {1.0, 2.0}, {1, 0, 0, 1, 0, 1}};
      message_of([&] { policy.offer(0, {&unequal, 1}); }, ErrorCode::input);
      const Factor vague{world.types().edge, {0, n}, {1.0, 2.0, 0.0}, {1, 0, 0, -1, 0, 1}};
      message_of([&] { policy.offer(0, {&vague, 1}); }, ErrorCode::input);
      // It has been asked about 0 now, and so has the other.
      quiet.policy().offer(0, {});
      policy.offer(0, {});
    }
    for (Robot* robot : {&disturbed, &quiet}) {
      while (const auto match = robot->policy().next_match()) {
        const Factor link = robot->right(match->earlier);
        if (match->earlier % 3 == 0) {
          robot->offer(link);
        } else {
          robot->policy().offer(match->earlier, {});
        }
      }
    }
    const PoseReport a = policy.end_pose(), b = quiet.policy().end_pose();
    EXPECT_EQ(a.kept, b.kept);
    EXPECT_EQ(a.candidates, b.candidates);
    EXPECT_EQ(a.least_gain, b.least_gain);
    EXPECT_EQ(a.closed_loop, b.closed_loop);
    EXPECT_EQ(a.links.size(), b.links.size());

    EXPECT_THROW(policy.end_pose(), Error);
    EXPECT_THROW(policy.next_match(), Error);
    EXPECT_THROW(policy.offer(0, {}), Error);
    EXPECT_THAT(refuse(world.variable(n + 1), {}), HasSubstr("without odometry from pose"));
    EXPECT_THAT(refuse(world.variable(n), {world.edge(n, n + 1, world.identity(), I)}),
                HasSubstr("is there already"));
    EXPECT_THAT(refuse(world.variable(0), {world.edge(n, n + 1, world.identity(), I)}),
                HasSubstr("is there already"));
    EXPECT_THAT(refuse(world.variable(n + 1), {world.edge(n + 2, n + 1, world.identity(), I)}),
                HasSubstr("not between poses"));
    EXPECT_THAT(refuse({registry.variable_type("VERTEX_SE3:QUAT"), n + 1, {}, false},
                       {world.edge(n, n + 1, world.identity(), I)}),
                HasSubstr("VERTEX_SE3:QUAT"));
    refuse(world.variable(n + 1),
           {Factor{registry.factor_type("EDGE_SE2_XY"), {n, n + 1}, {1, 2}, {1, 0, 1}}});
    refuse(world.variable(n + 1),
           {Factor{world.types().edge, {n, n + 1}, {1, 2, NAN}, {1, 0, 0, 1, 0, 1}}});
    disturbed.begin();
    quiet.begin();
    EXPECT_EQ(policy.newest_state(), quiet.policy().newest_state());
  }
  policy.end_pose();
  policy.finish();
  quiet.policy().end_pose();
  quiet.policy().finish();
  EXPECT_EQ(policy.estimator().chi2(), quiet.policy().estimator().chi2());
  EXPECT_GT(policy.estimator().factor_count(), policy.estimator().variable_count());
}

TEST_F(CompactPoseTest, TheFirstPoseHasNotMoved) {
  const PoseWorld world(planar_types(registry));
  const auto policy = make("range=2");
  const Factor moved = world.edge(0, 1, world.identity(), MatrixXd::Identity(3, 3));
  EXPECT_THAT(message_of(
                  [&] {
                    policy->add_pose(world.variable(1), {&moved, 1});
                  },
                  ErrorCode::input),
              HasSubstr("first"));
  policy->add_pose(world.variable(1), {});
  EXPECT_TRUE(policy->end_pose().kept);
  EXPECT_EQ(policy->newest_state(), world.identity());
}

TEST_F(CompactPoseTest, RefusesASensorThatIsNoCovariance) {
  for (const std::string sensor :
       {"1 2 3", "0 0", "0.1 0", "nan 1", "1 0 0 -1 0 1", "1 2 0 1 0 1", "inf inf", "0.1 x"}) {
    const PoseWorld world(planar_types(registry));
    EXPECT_THAT(message_of(
                    [&] {
                      const auto policy = registry.make<PosePolicy>(
                          ComponentSpec{"compact_pose", {{"sensor", sensor}}});
                      policy->add_pose(world.variable(0, world.identity()), {});
                    },
                    ErrorCode::usage),
                HasSubstr("sensor"))
        << sensor;
  }
}

TEST_F(CompactPoseTest, ATypeThatIsNoRigidMotionIsRefused) {
  const auto policy = make("range=2");
  const Variable point{registry.variable_type("VERTEX_XY"), 0, {1.0, 2.0}, false};
  message_of([&] { policy->add_pose(point, {}); }, ErrorCode::usage);
  const PoseWorld world(planar_types(registry));
  policy->add_pose(world.variable(0, world.identity()), {});  // goes on
  EXPECT_TRUE(policy->end_pose().kept);
}

// Rounding takes the digits of the last poses' covariances: no decision is made of what is left.
TEST_F(CompactPoseTest, DecidesNothingByACovarianceWithoutDigits) {
  const PoseWorld world{planar_types(registry)};
  const auto policy = registry.make<PosePolicy>("compact_pose:range=1000,angle=3.15,pose_gain=0");
  const MatrixXd S = Eigen::Vector3d(1e-8, 1e-8, 1e-2).asDiagonal();
  const auto step = [&](Id from, Id to) {
    return world.edge(from, to, {100.0 * static_cast<double>(to - from), 0.0, 0.0}, S);
  };
  policy->add_pose(world.variable(0, world.identity(), true), {});
  const auto drive_and_match = [&] {
    for (Id k = 1; k <= 100; ++k) {
      policy->end_pose();
      const Factor odometry = step(k - 1, k);
      policy->add_pose(world.variable(k), {&odometry, 1});
    }
    // Between neighbours, so that the poses before are as uncertain as they were.
    for (const Id other : {98, 97}) {
      const Factor link = step(other, 100);
      policy->offer(other, {&link, 1});
    }
  };
  EXPECT_THAT(message_of(drive_and_match, ErrorCode::numerical),
              HasSubstr("there is no covariance of "));
}

}  // namespace
}  // namespace cairn::compact
