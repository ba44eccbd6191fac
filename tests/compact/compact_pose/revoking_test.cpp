// SPDX-License-Identifier: BSD-3-Clause
// Links that are taken back: the graph is as if they had never been.
#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "compact/compact_pose/robot.hpp"
#include "compact/support/policy_runs.hpp"
#include "relocation.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"
#include "ways.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using test::Draw;
using test::PoseWorld;
using testing::HasSubstr;
using Pose = PoseWorld::Pose;

constexpr Id kMap = 1000;  ///< the first pose of the map

/// A robot that drives along a map, in the plane or in space. None of its poses is kept but the
/// first, which a link locates on the map, so that sessions with and without a link keep the same.
class Revoking : public testing::TestWithParam<int> {
 protected:
  static constexpr int kPlaces = 24;

  Revoking() : world_(test::types_of(GetParam(), registry_)), draw_(5) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(world_.tangent());
    step[0] = 1.0;
    step[step.size() - 1] = 0.2;
    if (GetParam() == 3) step[3] = 0.05;
    truth_.push_back(world_.identity());
    for (int k = 1; k < kPlaces; ++k) truth_.push_back(world_.moved(truth_.back(), step));
    for (int k = 1; k < kPlaces; ++k) odometry_.push_back(measured(k - 1, k, 0.03));
  }
  MatrixXd Sigma(double sigma) const {
    return sigma * sigma * MatrixXd::Identity(world_.tangent(), world_.tangent());
  }
  Motion measured(int from, int to, double sigma) {
    const Pose motion = world_.between(truth_[from], truth_[to]);
    return world_.motion(world_.moved(motion, draw_.error(Sigma(sigma))), Sigma(sigma));
  }
  Factor factor(Id from, Id to, const Motion& motion) const {
    return world_.motions().to_factor(world_.types().edge, from, to, motion);
  }

  /// Locates its first pose.
  std::unique_ptr<PosePolicy> policy(
      const std::string& options = "reuse=true,pose_gain=1e9,reuse_loss=10") {
    Draw draw(17);
    Graph map;
    for (int k = 0; k < kPlaces; ++k) {
      const int v = map.add_variable(world_.types().pose, kMap + k, truth_[k]);
      if (k == 0) continue;
      const Factor edge = world_.edge(
          kMap + k - 1, kMap + k,
          world_.moved(world_.between(truth_[k - 1], truth_[k]), draw.error(Sigma(0.03))),
          Sigma(0.03));
      map.add_factor(edge.type, std::array{v - 1, v}, edge.measurement, edge.information);
    }
    auto made = registry_.make<PosePolicy>(
        "compact_pose:estimator=batch,range=1000,angle=3.15,loop_gain=0," + options);
    made->load(map);
    made->add_pose(world_.variable(0, world_.identity()), {});
    const Factor here = factor(kMap, 0, world_.motion(world_.identity(), Sigma(0.02)));
    EXPECT_EQ(made->offer(kMap, {&here, 1}).verdict, LinkVerdict::linked);
    return made;
  }
  void go(PosePolicy& policy, Id pose) const {
    policy.end_pose();
    const Factor moved = factor(pose - 1, pose, odometry_[static_cast<std::size_t>(pose) - 1]);
    policy.add_pose(world_.variable(pose), {&moved, 1});
  }
  /// A match of the newest pose with a kept one; `off` the truth.
  Motion match(Id kept, Id pose, double off = 0.0) {
    const int place = static_cast<int>(kept < kMap ? kept : kept - kMap);
    Motion motion = measured(place, static_cast<int>(pose), 0.04);
    motion.mean[0] += off;
    return motion;
  }
  void offer(PosePolicy& policy, Id kept, Id pose, const Motion& motion) const {
    const Factor link = factor(kept, pose, motion);
    EXPECT_EQ(policy.offer(kept, {&link, 1}).verdict, LinkVerdict::linked) << kept << " " << pose;
  }

  /// Everything that can be read of the two.
  void expect_same(PosePolicy& one, PosePolicy& other, double covariances = 1e-6) {
    ASSERT_EQ(one.kept(), other.kept());
    EXPECT_EQ(one.factor_count(), other.factor_count());
    const auto apart = [&](std::span<const double> a, std::span<const double> b) {
      return world_.log(world_.between(a, b)).norm();
    };
    EXPECT_LT(apart(one.newest_state(), other.newest_state()), 1e-7);
    const int n = world_.tangent();
    for (const Id id : one.kept()) {
      EXPECT_LT(apart(one.estimator().state(id), other.estimator().state(id)), 1e-7) << id;
      MatrixXd S(n, n), S_other(n, n);
      for (const Id with : {id, one.kept().back()}) {
        one.estimator().covariance(id, with, {S.data(), static_cast<std::size_t>(S.size())});
        other.estimator().covariance(id, with,
                                     {S_other.data(), static_cast<std::size_t>(S.size())});
        EXPECT_LT((S - S_other).norm(), covariances * (1e-6 + S_other.norm())) << id << " " << with;
      }
    }
    const Graph way = recovered_trajectory(one, Recovery::likely),
                other_way = recovered_trajectory(other, Recovery::likely);
    ASSERT_EQ(way.variable_count(), other_way.variable_count());
    for (int v = 0; v < way.variable_count(); ++v)
      EXPECT_LT(apart(way.state(v), other_way.state(*other_way.find(way.id(v)))), 1e-6) << v;
    // And the estimate is the minimum of what is left.
    Graph minimum = one.estimator().graph();
    EXPECT_LT(test::solve_densely(minimum), 1e-5);
  }

  Registry registry_;
  PoseWorld world_;
  Draw draw_;
  std::vector<Pose> truth_;
  std::vector<Motion> odometry_;
};

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, Revoking, testing::Values(2, 3));

TEST_P(Revoking, ALinkOfAPoseThatIsKept) {
  const auto with = policy("reuse=false,pose_gain=0.01"),
             without = policy("reuse=false,pose_gain=0.01");
  for (Id pose = 1; pose < 12; ++pose) {
    for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
    if (pose % 4 != 0) continue;
    const Motion right = match(kMap + pose, pose), wrong = match(kMap + pose - 2, pose, 3.0);
    offer(*with, kMap + pose - 2, pose, wrong);
    for (PosePolicy* one : {with.get(), without.get()}) offer(*one, kMap + pose, pose, right);
  }
  EXPECT_FALSE(with->revoke(kMap + 3, 8));
  for (const Id pose : {8, 4}) {
    EXPECT_TRUE(with->revoke(pose, kMap + pose - 2));
    EXPECT_FALSE(with->revoke(pose, kMap + pose - 2));
  }
  for (PosePolicy* one : {with.get(), without.get()}) {
    go(*one, 12);
    one->end_pose();
    one->finish();
  }
  expect_same(*with, *without);
}

TEST_P(Revoking, ALinkByWhichTheWayGoesOnFromAnotherPose) {
  for (const bool later : {false, true}) {
    const auto with = policy(), without = policy();
    for (Id pose = 1; pose <= 4; ++pose) {
      for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
    }
    offer(*with, kMap + 6, 4, match(kMap + 6, 4, 2.0));
    if (later) {
      for (Id pose = 5; pose <= 7; ++pose) {
        for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
      }
    }
    EXPECT_TRUE(with->revoke(kMap + 6, 4));
    EXPECT_FALSE(with->revoke(kMap + 6, 4));
    for (Id pose = later ? 8 : 5; pose <= 10; ++pose) {
      for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
    }
    // What comes is judged alike.
    const Motion right = match(kMap + 10, 10);
    for (PosePolicy* one : {with.get(), without.get()}) {
      offer(*one, kMap + 10, 10, right);
      one->end_pose();
      one->finish();
    }
    expect_same(*with, *without);
  }
}

/// A second match with the same pose was another measurement of the way from there; now it ends
/// the way that led there.
TEST_P(Revoking, TheFirstOfTwoLinksToOnePose) {
  const auto with = policy(), without = policy();
  for (Id pose = 1; pose <= 6; ++pose) {
    for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
    if (pose == 4) offer(*with, kMap + 5, 4, match(kMap + 5, 4, 1.0));
    if (pose != 6) continue;
    const Motion right = match(kMap + 5, 6);
    for (PosePolicy* one : {with.get(), without.get()}) offer(*one, kMap + 5, 6, right);
  }
  EXPECT_TRUE(with->revoke(kMap + 5, 4));
  for (PosePolicy* one : {with.get(), without.get()}) {
    go(*one, 7);
    one->end_pose();
    one->finish();
  }
  expect_same(*with, *without);
}

/// Without the link between, the next one measures the way from where it began.
TEST_P(Revoking, ALinkBetweenTwoToOnePose) {
  const auto with = policy(), without = policy();
  for (Id pose = 1; pose <= 8; ++pose) {
    for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
    if (pose == 3) offer(*with, kMap + 5, 3, match(kMap + 5, 3, 1.0));
    if (pose != 6) continue;
    const Motion right = match(0, 6);
    for (PosePolicy* one : {with.get(), without.get()}) offer(*one, 0, 6, right);
  }
  EXPECT_TRUE(with->revoke(3, kMap + 5));
  for (PosePolicy* one : {with.get(), without.get()}) {
    one->end_pose();
    one->finish();
  }
  expect_same(*with, *without);
}

/// The factor between the poses where the way begins and ends then is that of all odometry between,
/// and of the second match as it was divided.
TEST_P(Revoking, AnEarlierLinkThanTheLatest) {
  const auto with = policy();
  const Motion first = match(kMap + 9, 3, 1.0), second = match(kMap + 7, 7);
  for (Id pose = 1; pose <= 7; ++pose) {
    go(*with, pose);
    if (pose == 3) offer(*with, kMap + 9, 3, first);
    if (pose == 7) offer(*with, kMap + 7, 7, second);
  }
  EXPECT_TRUE(with->revoke(kMap + 9, 3));
  const MotionGroup& group = world_.motions();
  const auto way = [&](int from, int to) {
    Motion all = odometry_[static_cast<std::size_t>(from)];
    for (int k = from + 1; k < to; ++k)
      all = group.compose(all, odometry_[static_cast<std::size_t>(k)]);
    return all;
  };
  const int n = world_.tangent();
  const double of_first =
      part_of_way(to_matrix(way(0, 3).covariance, n), to_matrix(first.covariance, n));
  const Motion until = group.compose(part_of(first, 1.0 - of_first), way(3, 7));
  const double of_second =
      part_of_way(to_matrix(until.covariance, n), to_matrix(second.covariance, n));
  const Motion expected = group.compose(way(0, 7), group.inverse(part_of(second, of_second)));
  int found = 0;
  Estimator& estimator = with->estimator();
  for (const FactorId id : estimator.factors()) {
    const Factor factor = estimator.factor(id);
    const auto& on = factor.variables;
    if (std::ranges::count(on, kMap + 9) > 0) {  // on the map it has its neighbours, and no others
      EXPECT_TRUE(std::ranges::all_of(on, [](Id pose) { return pose >= kMap + 8; }));
      EXPECT_TRUE(std::ranges::all_of(on, [](Id pose) { return pose <= kMap + 10; }));
    }
    if (std::ranges::count(on, 0) == 0 || std::ranges::count(on, kMap + 7) == 0) continue;
    ++found;
    const Motion bridge = group.of_factor(factor, 0);
    EXPECT_LT(world_.log(world_.between(bridge.mean, expected.mean)).norm(), 1e-9);
    EXPECT_LT(test::difference(to_matrix(bridge.covariance, n), to_matrix(expected.covariance, n)),
              1e-9);
  }
  EXPECT_EQ(found, 1);
  Graph minimum = estimator.graph();
  EXPECT_LT(test::solve_densely(minimum), 1e-5);
}

/// Whatever was linked, in whatever order it is taken back.
TEST_P(Revoking, AllLinksInAnyOrder) {
  for (int trial = 0; trial < 12; ++trial) {
    // Covariances of the fourth order depend a little on which are composed first.
    const bool fourth = trial % 3 == 2;
    const std::string options = std::string("reuse=true,pose_gain=1e9,reuse_loss=10") +
                                (fourth ? ",composition=fourth" : "");
    const auto with = policy(options), without = policy(options);
    std::vector<std::pair<Id, Id>> links;
    std::vector<Id> to{0, kMap + 4, kMap + 5, kMap + 9};
    const auto take_back = [&](std::size_t k) {
      EXPECT_TRUE(with->revoke(links[k].first, links[k].second));
      std::swap(links[k], links.back());
      links.pop_back();
    };
    for (Id pose = 1; pose < kPlaces; ++pose) {
      for (PosePolicy* one : {with.get(), without.get()}) go(*one, pose);
      if (draw_.chance(0.5)) {
        const Id kept = to[static_cast<std::size_t>(draw_.integer(4))];
        const Factor link = factor(kept, pose, match(kept, pose, 0.1));
        const LinkReport report = with->offer(kept, {&link, 1});
        if (report.verdict == LinkVerdict::linked) links.emplace_back(kept, pose);
      }
      if (!links.empty() && draw_.chance(0.2))
        take_back(static_cast<std::size_t>(draw_.integer(static_cast<int>(links.size()))));
    }
    for (PosePolicy* one : {with.get(), without.get()}) one->end_pose();
    if (trial % 2 == 0) {
      for (PosePolicy* one : {with.get(), without.get()}) one->finish();
    }
    while (!links.empty())
      take_back(static_cast<std::size_t>(draw_.integer(static_cast<int>(links.size()))));
    for (PosePolicy* one : {with.get(), without.get()}) one->finish();
    expect_same(*with, *without, fourth ? 1e-4 : 1e-6);
    EXPECT_EQ(with->kept().size(), kPlaces + 2U);
  }
}

TEST_P(Revoking, NotWhatAloneConnectsTheMap) {
  const auto one = policy();
  go(*one, 1);
  EXPECT_THAT(message_of([&] { one->revoke(kMap, 0); }, ErrorCode::input),
              HasSubstr("is all that connects the trajectory to the map"));
  offer(*one, kMap + 2, 1, match(kMap + 2, 1));
  EXPECT_TRUE(one->revoke(kMap, 0));
  EXPECT_THAT(message_of([&] { one->revoke(kMap + 2, 1); }, ErrorCode::input),
              HasSubstr("all that connects"));
  one->end_pose();
  EXPECT_TRUE(one->finish());
}

TEST_F(CompactPoseTest, ALinkThatWaitsCanBeRevoked) {
  Robot robot(registry, "strategy=apfl,range=4,angle=3.15,gate=0.99,trust=0.000001");
  for (int k = 0; k < 60; ++k) robot.advance();
  ASSERT_EQ(robot.offer(robot.right(1)).verdict, LinkVerdict::waiting);
  EXPECT_TRUE(robot.policy().revoke(1, robot.newest()));
  EXPECT_FALSE(robot.policy().revoke(1, robot.newest()));
  robot.advance();
  // Nothing is left that could agree with it.
  EXPECT_EQ(robot.offer(robot.right(2)).verdict, LinkVerdict::waiting);
}

/// The newest pose is matched again with others, not with the one that was false.
TEST_F(CompactPoseTest, AfterALinkWasRevokedTheOthersTellMoreAgain) {
  Robot robot(registry, "strategy=apfl,range=1000,angle=3.15,probability=0,loop_gain=0.5");
  for (int k = 0; k < 30; ++k) robot.advance();
  const auto before = robot.policy().next_match();
  ASSERT_TRUE(before);
  robot.offer(robot.right(before->earlier, 0.001));
  const auto after = robot.policy().next_match();
  EXPECT_TRUE(!after || after->gain < before->gain);
  EXPECT_TRUE(robot.policy().revoke(before->earlier, robot.newest()));
  const auto again = robot.policy().next_match();
  ASSERT_TRUE(again);
  EXPECT_NE(again->earlier, before->earlier);
  EXPECT_GT(again->gain, 0.9 * before->gain);
  EXPECT_FALSE(robot.policy().end_pose().closed_loop);
}

/// With poses that leave, some links are part of what replaced them: they are refused, and the rest
/// goes on.
TEST(RevokingWherePosesLeave, IsRefusedWhereItCannotBeToldApart) {
  Registry registry;
  const Simulation world =
      test::simulate(registry, "ellipse_n:poses_per_lap=40,loop_density=0,laps=6");
  const auto policy =
      registry.make<PosePolicy>("compact_pose:range=4,angle=0.4,keep=20,reuse=true");
  const auto registration = registry.make<Registration>("simulated:range=4,angle=0.4");
  registration->begin({.recording = &world.graph, .truth = &world.truth});
  std::vector<std::pair<Id, Id>> links;
  const std::vector<Arrival> poses = pose_chain(world.graph);
  int revoked = 0, gone = 0, refused = 0;
  run_policy(world.graph, poses, *policy, *registration, [&](const PoseReport& report) {
    for (const LinkReport& link : report.links) {
      if (link.verdict == LinkVerdict::linked) links.emplace_back(link.earlier, link.later);
    }
    if (report.id % 5 != 0 || links.empty()) return true;
    for (const std::size_t k : {links.size() - 1, links.size() / 2}) {
      const int factors = policy->factor_count();
      try {
        (policy->revoke(links[k].first, links[k].second) ? revoked : gone) += 1;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::input);
        EXPECT_THAT(error.what(), HasSubstr("cannot be separated"));
        EXPECT_EQ(policy->factor_count(), factors);
        ++refused;
      }
    }
    return true;
  });
  EXPECT_GT(revoked, 20);
  EXPECT_GT(gone + refused, 10);
  EXPECT_GT(refused, 0);
  Graph map = policy->estimator().graph();
  EXPECT_EQ(map.variable_count(), 20);
  EXPECT_LT(test::solve_densely(map), 1e-2);
}

}  // namespace
}  // namespace cairn::compact
