// SPDX-License-Identifier: BSD-3-Clause
// Absolute measurements, such as positions from GPS, under a policy: what they are worth, and what
// becomes of the map.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "compact/compact_pose/robot.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::dense_system;
using test::Draw;
using test::log_determinant_of;
using test::PolicyRun;
using test::PoseWorld;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Pose = PoseWorld::Pose;

/// A robot on a winding road, in the plane or in space, and everything it measures as a graph of
/// its own, whether the policy keeps it or not.
class Priors : public testing::TestWithParam<int> {
 protected:
  Priors() : world_(test::types_of(GetParam(), registry_)), draw_(3) {}

  std::shared_ptr<const FactorType> prior_type() {
    return registry_.factor_type(GetParam() == 2 ? "EDGE_PRIOR_SE2" : "EDGE_PRIOR_SE3:QUAT");
  }
  MatrixXd Sigma(double translation, double rotation) const {
    VectorXd sigmas = VectorXd::Constant(world_.tangent(), rotation);
    sigmas.head(GetParam()).setConstant(translation);
    return sigmas.cwiseAbs2().asDiagonal();
  }
  VectorXd bend(int k) const {
    VectorXd step = VectorXd::Zero(world_.tangent());
    step[0] = 1.0;
    step[step.size() - 1] = 0.4 * std::sin(0.3 * k);
    if (GetParam() == 3) step[4] = 0.2 * std::cos(0.2 * k);
    return step;
  }
  void begin(const std::string& options, const Pose& start, bool fixed) {
    policy_ = registry_.make<PosePolicy>("compact_pose:range=1000,angle=3.15,reuse=true" +
                                         (options.empty() ? "" : "," + options));
    truth_ = {start};
    all_ = {};
    all_.set_fixed(all_.add_variable(world_.types().pose, 0, start), fixed);
    policy_->add_pose(world_.variable(0, start, fixed), {});
  }
  Id newest() const { return static_cast<Id>(truth_.size()) - 1; }
  void put(const Factor& factor) {
    std::vector<int> on;
    for (const Id id : factor.variables) on.push_back(*all_.find(id));
    all_.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  Factor measured(Id from, Id to, const MatrixXd& S) {
    const Pose motion = world_.between(truth_[from], truth_[to]);
    return world_.edge(from, to, world_.moved(motion, draw_.error(S)), S);
  }
  PoseReport advance() {
    const PoseReport report = policy_->end_pose();
    truth_.push_back(world_.moved(truth_.back(), bend(static_cast<int>(truth_.size()))));
    const Factor odometry = measured(newest() - 1, newest(), Sigma(0.05, 0.02));
    all_.add_variable(world_.types().pose, newest(), truth_.back());
    put(odometry);
    policy_->add_pose(world_.variable(newest()), {&odometry, 1});
    return report;
  }
  LinkReport link(Id other) {
    const Factor factor = measured(other, newest(), Sigma(0.1, 0.05));
    put(factor);
    return policy_->offer(other, {&factor, 1});
  }
  /// `rotation` 0: of the position alone.
  Factor prior(double translation, double rotation = 0.0) {
    const MatrixXd S = Sigma(translation, rotation > 0.0 ? rotation : 1.0);
    VectorXd error = draw_.error(S);
    MatrixXd information = test::symmetric_inverse(S);
    if (rotation == 0.0) {
      const int rest = world_.tangent() - GetParam();
      error.tail(rest).setZero();
      information.bottomRightCorner(rest, rest).setZero();
    }
    return {prior_type(), {newest()}, world_.moved(truth_.back(), error), pack(information)};
  }
  /// The graph of everything, at the policy's estimate; all poses must be kept.
  Graph at_estimate() {
    Graph graph = all_.clone();
    for (int v = 0; v < graph.variable_count(); ++v) {
      graph.set_state(v, graph.id(v) == newest() ? policy_->newest_state()
                                                 : policy_->estimator().state(graph.id(v)));
    }
    return graph;
  }
  static void put(Graph& graph, const Factor& factor) {
    const std::array<int, 1> on{*graph.find(factor.variables.front())};
    graph.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  double distance(const Pose& a, const Pose& b) const {
    return (world_.split(a).second - world_.split(b).second).norm();
  }

  Registry registry_;
  PoseWorld world_;
  Draw draw_;
  std::unique_ptr<PosePolicy> policy_;
  std::vector<Pose> truth_;
  Graph all_;
};

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, Priors, testing::Values(2, 3));

TEST_P(Priors, TheGainIsTheEntropyThatTheGraphLoses) {
  for (const double rotation : {0.0, 0.03}) {
    begin("strategy=apfl,estimator=batch,loop_gain=0.5", world_.identity(), true);
    for (int k = 1; k <= 14; ++k) {
      advance();
      if (k == 8) {
        ASSERT_EQ(link(1).verdict, LinkVerdict::linked);
      }
      if (k % 5 != 4 && k != 8) continue;
      const Graph before = at_estimate();
      Graph after = before.clone();
      const Factor measurement = prior(0.2, rotation);
      put(after, measurement);
      const double gain = 0.5 * (log_determinant_of(dense_system(after).H) -
                                 log_determinant_of(dense_system(before).H));
      const PriorReport report = policy_->offer_prior(measurement);
      EXPECT_EQ(report.pose, newest());
      EXPECT_NEAR(report.gain, gain, 1e-6 * gain) << k;
      EXPECT_EQ(report.verdict, gain > 0.5 ? LinkVerdict::linked : LinkVerdict::uninformative);
      if (report.verdict == LinkVerdict::linked) put(measurement);
    }
    // What was taken is in the estimate, and nothing else.
    policy_->end_pose();
    ASSERT_TRUE(policy_->finish());
    Graph minimum = all_.clone();
    test::solve_densely(minimum);
    for (int v = 0; v < minimum.variable_count(); ++v) {
      const Pose x(minimum.state(v).begin(), minimum.state(v).end());
      const auto estimate = policy_->estimator().state(minimum.id(v));
      EXPECT_LT(world_.log(world_.between(x, estimate)).norm(), 1e-6) << minimum.id(v);
    }
    EXPECT_GT(all_.factor_count(), 15);
  }
}

TEST_P(Priors, APoseWithOneIsKept) {
  begin("pose_gain=1e9,loop_gain=0.5", world_.identity(), true);
  for (int k = 1; k <= 30; ++k) {
    const bool was_measured = k == 21;
    EXPECT_EQ(advance().kept, k == 1 || was_measured) << k;
    if (k == 20) {
      EXPECT_EQ(policy_->offer_prior(prior(0.02)).verdict, LinkVerdict::linked);
      EXPECT_EQ(policy_->offer_prior(prior(5.0)).verdict, LinkVerdict::uninformative);
    }
  }
  const PoseReport report = policy_->end_pose();
  EXPECT_FALSE(report.kept);
  EXPECT_THAT(report.priors, IsEmpty());
  EXPECT_EQ(policy_->kept(), (std::vector<Id>{0, 20}));
}

/// Without loop closures the error of odometry grows without bound; with a position every tenth
/// pose it does not, though few of the positions are used.
TEST_P(Priors, BoundTheErrorOfOdometry) {
  constexpr int kPoses = 1500;
  double worst_without = 0.0, worst[2] = {0.0, 0.0};  // in each half of the road
  std::int64_t offered = 0, taken = 0;
  for (const bool with : {false, true}) {
    begin("", world_.identity(), true);
    for (int k = 1; k <= kPoses; ++k) {
      advance();
      if (with && k % 10 == 0) {
        ++offered;
        taken += policy_->offer_prior(prior(0.5)).verdict == LinkVerdict::linked;
      }
      double& furthest = with ? worst[2 * k > kPoses] : worst_without;
      furthest = std::max(furthest, distance(policy_->newest_state(), truth_.back()));
    }
    policy_->end_pose();
  }
  EXPECT_GT(worst_without, 30.0);
  EXPECT_LT(worst[0], 10.0);
  EXPECT_LT(worst[1], 10.0);
  EXPECT_GT(taken, 15);
  EXPECT_LT(2 * taken, offered);
}

/// Positions of a graph that nothing holds wait until they determine where it is.
TEST_P(Priors, OfAGraphThatNothingHoldsWaitForOneAnother) {
  VectorXd far = VectorXd::Constant(world_.tangent(), 0.3);
  far.head(GetParam()).setConstant(50.0);
  far.tail(1).setConstant(2.5);
  begin("strategy=apfl,estimator=batch", world_.identity(), false);
  // The world is elsewhere than where the robot thinks that it begins.
  truth_ = {world_.exp(far)};
  std::int64_t waiting = 0, taken = 0;
  for (int k = 1; k <= 40; ++k) {
    const PoseReport report = advance();
    for (const PriorReport& prior : report.priors) {
      waiting += prior.verdict == LinkVerdict::waiting;
      taken += prior.verdict == LinkVerdict::linked;
    }
    if (k % 8 != 0) continue;
    const Factor position = prior(0.1);
    if (k == 8) {
      EXPECT_EQ(policy_->offer_prior(position).verdict, LinkVerdict::waiting);
      EXPECT_GT(distance(policy_->newest_state(), truth_.back()), 20.0);
      // The same again says nothing new, and does not wait as well.
      const PriorReport again = policy_->offer_prior(position);
      EXPECT_EQ(again.verdict, LinkVerdict::uninformative);
      EXPECT_NEAR(again.gain, 0.5 * GetParam() * std::log(2.0), 1e-3);
    } else {
      policy_->offer_prior(position);
    }
  }
  policy_->end_pose();
  EXPECT_GE(waiting, 1);
  EXPECT_GE(taken, 2);
  EXPECT_LT(distance(policy_->newest_state(), truth_.back()), 1.0);
  ASSERT_TRUE(policy_->finish());
  Graph minimum = policy_->estimator().graph();
  EXPECT_LT(test::solve_densely(minimum), 1e-5);
  // Its covariance is that of all its factors.
  const MatrixXd Sigma = dense_system(minimum).Sigma();
  const int n = world_.tangent();
  MatrixXd block(n, n);
  policy_->estimator().covariance(newest(), newest(),
                                  {block.data(), static_cast<std::size_t>(block.size())});
  EXPECT_LT(test::difference(block, Sigma.bottomRightCorner(n, n)), 1e-5);
}

TEST_P(Priors, WhatWaitsIsJudgedWhereAPoseIsFixed) {
  begin("strategy=apfl", world_.identity(), false);
  for (int k = 1; k <= 5; ++k) advance();
  EXPECT_EQ(policy_->offer_prior(prior(0.01)).verdict, LinkVerdict::waiting);
  policy_->end_pose();
  truth_.push_back(world_.moved(truth_.back(), bend(6)));
  const Factor odometry = measured(5, 6, Sigma(0.05, 0.02));
  policy_->add_pose(world_.variable(6, truth_.back(), true), {&odometry, 1});
  const PoseReport report = policy_->end_pose();
  ASSERT_THAT(report.priors, SizeIs(1));
  EXPECT_EQ(report.priors.front().pose, 5);
  EXPECT_EQ(report.priors.front().verdict, LinkVerdict::linked);
  EXPECT_GT(report.priors.front().gain, 2.0);
}

TEST_P(Priors, ThatContradictAreNotUsedWithAGate) {
  for (const bool gate : {false, true}) {
    begin(gate ? "gate=0.99" : "", world_.identity(), true);
    for (int k = 1; k <= 30; ++k) advance();
    Factor wrong = prior(0.05);
    wrong.measurement[0] += 100.0;
    const PriorReport report = policy_->offer_prior(wrong);
    EXPECT_EQ(report.verdict, gate ? LinkVerdict::inconsistent : LinkVerdict::linked);
    EXPECT_GT(report.innovation, 100.0);
    if (gate) {
      EXPECT_EQ(policy_->offer_prior(prior(0.05)).verdict, LinkVerdict::linked);
    }
  }
}

TEST_P(Priors, WhatIsNoMeasurementOfTheNewestPoseIsRefused) {
  begin("", world_.identity(), true);
  advance();
  Factor of_another = prior(0.1);
  of_another.variables = {0};
  EXPECT_THAT(message_of([&] { policy_->offer_prior(of_another); }, ErrorCode::input),
              HasSubstr("not a measurement of this"));
  Factor indefinite = prior(0.1);
  indefinite.information[0] = -1.0;
  EXPECT_THAT(message_of([&] { policy_->offer_prior(indefinite); }, ErrorCode::input),
              HasSubstr("positive semidefinite"));
  const Factor odometry = measured(0, 1, Sigma(0.1, 0.1));
  EXPECT_THAT(message_of([&] { policy_->offer_prior(odometry); }, ErrorCode::input),
              HasSubstr("alone"));
  policy_->end_pose();
  EXPECT_THAT(message_of([&] { policy_->offer_prior(prior(0.1)); }, ErrorCode::usage),
              HasSubstr("without a pose"));
}

/// Where loop closures bound the map, positions do as well: each that is used leaves less to add.
TEST(RecordedPriors, TheMapOfAPlaceStopsGrowing) {
  CAIRN_NEEDS("types", "slam3d");
  Registry registry;
  const auto type = registry.factor_type("EDGE_PRIOR_SE3:QUAT");
  MatrixXd weights = MatrixXd::Zero(6, 6);
  weights.topLeftCorner(3, 3).diagonal().setConstant(4.0);
  const std::vector<double> information = pack(weights);
  std::vector<std::size_t> kept;
  std::vector<std::int64_t> taken;
  for (const std::string laps : {"20", "80"}) {
    Simulation world = test::simulate(
        registry,
        "ellipse_n:poses_per_lap=40,loop_density=0,translation_error=0,rotation_error=0,"
        "translation_sigma=0.02,rotation_sigma=0.005,laps=" +
            laps);
    Draw draw(11);
    for (int v = 0; v < world.graph.variable_count(); v += 7) {
      std::vector<double> position(world.truth.state(v).begin(), world.truth.state(v).end());
      for (int axis = 0; axis < 3; ++axis) position[axis] += 0.5 * draw.normal();
      const std::array<int, 1> on{v};
      world.graph.add_factor(type, on, position, information);
    }
    const PolicyRun run = test::run(registry, world, "compact_pose:range=5,angle=0.5,reuse=true",
                                    "simulated:range=5,angle=0.5");
    kept.push_back(run.policy->kept().size());
    taken.push_back(0);
    for (const PoseReport& report : run.reports) {
      taken.back() += std::ranges::count(report.priors, LinkVerdict::linked, &PriorReport::verdict);
    }
  }
  EXPECT_GT(taken[0], 0);
  EXPECT_LE(taken[1], taken[0] + 3);
  EXPECT_LE(kept[1], kept[0] + 8);
  EXPECT_LT(kept[1], 80U);
}

}  // namespace
}  // namespace cairn::compact
