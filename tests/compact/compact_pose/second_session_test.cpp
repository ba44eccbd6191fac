// SPDX-License-Identifier: BSD-3-Clause
// A trajectory that continues the map of an earlier one, at a place that it does not know.
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "compact/compact_pose/robot.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using test::Draw;
using test::PoseWorld;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Pose = PoseWorld::Pose;

constexpr Id kFirst = 100;  ///< of the second session

/// A circle of 20 positions, in the plane or in space, that two sessions drive along; the second
/// starts somewhere in the middle.
class SecondSession : public testing::TestWithParam<int> {
 protected:
  static constexpr int kPositions = 20;

  SecondSession() : world_(test::types_of(GetParam(), registry_)), draw_(7) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(world_.tangent());
    step[0] = 1.0;
    step[step.size() - 1] = 2.0 * 3.14159265358979 / kPositions;
    truth_.push_back(world_.identity());
    for (int k = 1; k < 3 * kPositions; ++k) truth_.push_back(world_.moved(truth_.back(), step));
  }

  MatrixXd Sigma(double sigma = 0.02) const {
    return sigma * sigma * MatrixXd::Identity(world_.tangent(), world_.tangent());
  }
  /// Between two positions, as poses with these ids.
  Factor measured(int from, int to, Id from_id, Id to_id) {
    return world_.edge(from_id, to_id,
                       world_.moved(world_.between(truth_[from], truth_[to]), draw_.error(Sigma())),
                       Sigma());
  }
  static void add(Graph& map, const Factor& factor) {
    const std::array<int, 2> on{*map.find(factor.variables[0]), *map.find(factor.variables[1])};
    map.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  /// The first session: once round, closed by one link.
  Graph first_map() {
    Graph map;
    for (int k = 0; k < kPositions; ++k) map.add_variable(world_.types().pose, k, truth_[k]);
    for (int k = 1; k < kPositions; ++k) add(map, measured(k - 1, k, k - 1, k));
    add(map, measured(0, kPositions - 1, 0, kPositions - 1));
    return map;
  }
  std::unique_ptr<PosePolicy> policy(const std::string& options = "") {
    return registry_.make<PosePolicy>("compact_pose:strategy=apfl,range=6,angle=3.15,reuse=false" +
                                      options);
  }
  /// A pose of the second session at a position, from its own beginning at `start`.
  void drive_to(PosePolicy& policy, int position, int start) {
    const Id id = kFirst + (position - start);
    if (position == start) return policy.add_pose(world_.variable(id, lost_), {});
    const Factor odometry = measured(position - 1, position, id - 1, id);
    policy.add_pose(world_.variable(id), {&odometry, 1});
  }

  Registry registry_;
  PoseWorld world_;
  Draw draw_;
  std::vector<Pose> truth_;
  Pose lost_ = world_.random(draw_, 50.0, 1.5);  ///< where the second session takes itself to be
};

TEST_P(SecondSession, IsLocatedByAMatchAndThenOneGraphWithTheMap) {
  const Graph map = first_map();
  const auto policy = this->policy();
  policy->load(map);
  EXPECT_THAT(policy->unlocated(), SizeIs(kPositions));
  std::vector<Factor> links;
  for (int k = 5; k < 15; ++k) {
    drive_to(*policy, k, 5);
    // However near its own frame puts the two, no pose of the map is proposed before one has
    // matched.
    while (const auto match = policy->next_match()) {
      EXPECT_GE(match->earlier, k < 10 ? kFirst : 0);
      policy->offer(match->earlier, {});
    }
    if (k == 10 || k == 14) {
      const Factor link = measured(k, k, k, kFirst + k - 5);
      const LinkReport report = policy->offer(k, {&link, 1});
      EXPECT_EQ(report.verdict, LinkVerdict::linked);
      EXPECT_EQ(std::isinf(report.gain), k == 10);
    }
    if (k == 10) {
      EXPECT_THAT(policy->unlocated(), IsEmpty());
      EXPECT_LT(world_.log(world_.between(policy->newest_state(), truth_[10])).norm(), 0.3);
      EXPECT_TRUE(policy->next_match());  // the poses of the map are candidates now
    }
    policy->end_pose();
  }
  EXPECT_TRUE(policy->finish());
  EXPECT_THAT(policy->kept(), SizeIs(kPositions + 10));

  // The same measurements, solved at once from the truth.
  Estimator& estimator = policy->estimator();
  const auto batch = registry_.make<Estimator>("batch");
  const Graph joined = estimator.graph();
  EXPECT_EQ(joined.factor_count(), map.factor_count() + 9 + 2);
  GraphUpdate update;
  for (int v = 0; v < joined.variable_count(); ++v) {
    Variable variable = joined.variable(v);
    variable.state = truth_[variable.id < kFirst ? variable.id : variable.id - kFirst + 5];
    update.variables.push_back(variable);
  }
  for (int f = 0; f < joined.factor_count(); ++f) update.factors.push_back(joined.factor(f));
  batch->update(update, {.full = true});
  EXPECT_NEAR(estimator.chi2(), batch->chi2(), 1e-6 * (1.0 + batch->chi2()));
  const int n = world_.tangent();
  for (const Id id : {Id{7}, kFirst, kFirst + 9}) {
    const auto mine = estimator.state(id), other = batch->state(id);
    EXPECT_LT(world_.log(world_.between(mine, other)).norm(), 1e-5) << id;
    MatrixXd S(n, n), expected(n, n);
    ASSERT_TRUE(estimator.covariance(id, id, {S.data(), static_cast<std::size_t>(S.size())}));
    ASSERT_TRUE(batch->covariance(id, id, {expected.data(), static_cast<std::size_t>(S.size())}));
    EXPECT_LT(test::difference(S, expected), 1e-4) << id;
  }
}

TEST_P(SecondSession, WithAGateTwoMatchesMustAgreeBeforeItIsLocated) {
  const auto policy = this->policy(",gate=0.99");
  policy->load(first_map());
  std::vector<LinkVerdict> verdicts;
  for (int k = 5; k < 9; ++k) {
    drive_to(*policy, k, 5);
    if (k > 5) {
      // The first is false: it says that position 6 is position 17.
      const int place = k == 6 ? 17 : k;
      const Factor link = measured(k, k, place, kFirst + k - 5);
      verdicts.push_back(policy->offer(place, {&link, 1}).verdict);
      EXPECT_EQ(policy->unlocated().empty(), k == 8) << k;
    }
    const PoseReport report = policy->end_pose();
    if (k == 8) {  // what had waited is judged now
      ASSERT_THAT(report.links, SizeIs(3));
      for (const LinkReport& link : report.links) {
        EXPECT_EQ(link.verdict == LinkVerdict::inconsistent, link.earlier == 17);
      }
    }
  }
  EXPECT_THAT(verdicts,
              ElementsAre(LinkVerdict::waiting, LinkVerdict::waiting, LinkVerdict::linked));
  EXPECT_LT(world_.log(world_.between(policy->newest_state(), truth_[8])).norm(), 0.3);
}

// What the second session had closed for itself before it was located moves with it.
TEST_P(SecondSession, KeepsItsOwnLoopClosures) {
  for (const bool reuse : {false, true}) {
    const auto policy = registry_.make<PosePolicy>(
        std::string("compact_pose:range=3,angle=1,reuse=") + (reuse ? "true" : "false"));
    policy->load(first_map());
    int closed = 0;
    for (int k = 0; k < 2 * kPositions + 4; ++k) {
      drive_to(*policy, k, 0);
      while (const auto match = policy->next_match()) {
        const int other = match->earlier < kFirst ? static_cast<int>(match->earlier)
                                                  : static_cast<int>(match->earlier - kFirst);
        const Factor link = measured(other, k, match->earlier, kFirst + k);
        closed += policy->offer(match->earlier, {&link, 1}).verdict == LinkVerdict::linked;
      }
      if (k == 2 * kPositions - 3) {
        EXPECT_GT(closed, 1);
        const Factor link = measured(k % kPositions, k, k % kPositions, kFirst + k);
        EXPECT_EQ(policy->offer(k % kPositions, {&link, 1}).verdict, LinkVerdict::linked);
      }
      policy->end_pose();
    }
    EXPECT_TRUE(policy->finish());
    Estimator& estimator = policy->estimator();
    const Graph joined = estimator.graph();
    for (int v = 0; v < joined.variable_count(); ++v) {
      const Id id = joined.id(v);
      const Pose& truth = truth_[id < kFirst ? id : id - kFirst];
      EXPECT_LT(world_.log(world_.between(joined.state(v), truth)).norm(), 0.5) << id;
    }
    EXPECT_LT(estimator.chi2(), 2.0 * world_.tangent() * joined.factor_count());
  }
}

TEST_P(SecondSession, RefusesAMapThatItCannotContinue) {
  Graph parts = first_map();
  parts.add_variable(world_.types().pose, 50, world_.identity());
  EXPECT_THAT(message_of([&] { policy()->load(parts); }, ErrorCode::input), HasSubstr("2 parts"));
  EXPECT_THAT(message_of([&] { policy()->load(Graph()); }, ErrorCode::input), HasSubstr("empty"));
  const auto used = policy();
  used->load(first_map());
  EXPECT_THAT(message_of([&] { used->load(first_map()); }, ErrorCode::usage),
              HasSubstr("second map"));
  EXPECT_THAT(message_of([&] { used->add_pose(world_.variable(3, lost_), {}); }, ErrorCode::input),
              HasSubstr("pose 3 is there already"));
  drive_to(*used, 0, 0);
  used->end_pose();
  const Factor odometry = measured(0, 1, kFirst, kFirst + 1);
  EXPECT_THAT(message_of(
                  [&] {
                    used->add_pose(world_.variable(kFirst + 1, lost_, true), {&odometry, 1});
                  },
                  ErrorCode::input),
              HasSubstr("unknown where the trajectory is on the map"));
  const auto random = registry_.make<PosePolicy>("random_poses:poses=3,loops=1");
  EXPECT_THAT(message_of([&] { random->load(first_map()); }, ErrorCode::usage),
              HasSubstr("compact_pose"));
}

INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, SecondSession, testing::Values(2, 3));

}  // namespace
}  // namespace cairn::compact
