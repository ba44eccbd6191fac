// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose_chain.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/planar_graph.hpp"
#include "support/scaled_pose.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using State = std::vector<double>;

class GraphElements : public testing::Test {
 protected:
  int pose(Id id) { return graph_.add_variable(types_.pose, id, std::array{1.0, 2.0, 0.3}); }
  /// By id.
  int join(Id a, Id b) {
    return graph_.add_factor(types_.relative_pose, std::array{*graph_.find(a), *graph_.find(b)},
                             std::array{1.0, 0.5, 0.1}, std::array{2.0, 0.0, 0.0, 3.0, 0.0, 4.0});
  }
  const test::PlanarTypes types_{};
  Graph graph_;
};

TEST_F(GraphElements, GivesVariablesAndFactorsAsAnEstimatorTakesThem) {
  pose(7);
  const int fixed = pose(3), factor = join(7, 3);
  graph_.set_fixed(fixed);
  const Variable variable = graph_.variable(fixed);
  EXPECT_EQ(variable.type, types_.pose);
  EXPECT_EQ(variable.id, 3);
  EXPECT_THAT(variable.state, ElementsAre(1.0, 2.0, 0.3));
  EXPECT_TRUE(variable.fixed);
  EXPECT_FALSE(graph_.variable(0).fixed);
  const Factor copy = graph_.factor(factor);
  EXPECT_EQ(copy.type, types_.relative_pose);
  EXPECT_THAT(copy.variables, ElementsAre(7, 3));
  EXPECT_THAT(copy.measurement, ElementsAre(1.0, 0.5, 0.1));
  EXPECT_THAT(copy.information, ElementsAre(2.0, 0.0, 0.0, 3.0, 0.0, 4.0));
}

// Recovery ----------------------------------------------------------------------------------------

/// Those that need no covariances.
constexpr std::array kAll{Recovery::uniform, Recovery::interpolate, Recovery::distribute};
constexpr double kRight = std::numbers::pi / 2.0;

/// In the plane, or in space; the tests say it in the words that both have.
class Recover : public testing::TestWithParam<bool> {
 protected:
  State exp(const Eigen::VectorXd& delta) const {
    State x(static_cast<std::size_t>(type_->ambient_size()));
    group_.exp(delta.data(), x.data());
    return x;
  }
  /// A twist along the first axis and about the last.
  State arc(double length, double angle) const {
    Eigen::VectorXd delta = Eigen::VectorXd::Zero(n_);
    delta[0] = length;
    delta[n_ - 1] = angle;
    return exp(delta);
  }
  State at(double x, double y, double angle) const {
    State pose = arc(0.0, angle);
    pose[0] = x;
    pose[1] = y;
    return pose;
  }
  State compose(const State& a, const State& b) const {
    State ab(a.size());
    group_.compose(a.data(), b.data(), ab.data());
    type_->normalize(ab.data());
    return ab;
  }
  State any() {
    Eigen::VectorXd delta(n_);
    for (double& x : delta) x = static_cast<double>(rng_()) / 0x1p31 - 1.0;
    return exp(delta);
  }
  /// Poses 11, 12, … after pose 10.
  static OdometryChain chain(const std::vector<State>& motions) {
    OdometryChain chain{10, 10, {}};
    for (const State& motion : motions) chain.steps.push_back({++chain.to, motion});
    return chain;
  }
  OdometryChain any_chain(int steps) {
    std::vector<State> motions;
    for (int k = 0; k < steps; ++k) motions.push_back(any());
    return chain(motions);
  }
  std::vector<State> states(const OdometryChain& chain, const State& from, const State& to,
                            Recovery how) const {
    std::vector<State> states;
    for (const RecoveredPose& pose : recover(*type_, chain, from, to, how)) {
      EXPECT_EQ(pose.id, chain.steps[states.size()].pose);
      states.push_back(pose.state);
    }
    return states;
  }
  OdometryChain with_covariances(OdometryChain chain) {
    for (ChainStep& step : chain.steps) {
      Eigen::MatrixXd root(n_, n_);
      for (double& x : root.reshaped()) x = static_cast<double>(rng_()) / 0x1p31 - 1.0;
      const Eigen::MatrixXd Sigma =
          root * root.transpose() + 0.1 * Eigen::MatrixXd::Identity(n_, n_);
      step.covariance.assign(Sigma.data(), Sigma.data() + Sigma.size());
    }
    return chain;
  }
  double distance(const State& a, const State& b) const {
    Eigen::VectorXd delta(n_);
    type_->local(1, a.data(), b.data(), delta.data());
    return delta.norm();
  }
  void expect_near(const State& a, const State& b) const { EXPECT_LT(distance(a, b), 1e-13); }

  const std::shared_ptr<const VariableType> type_ =
      GetParam() ? define_variable<Se3>() : define_variable<Se2>();
  const LieGroup& group_ = *type_->lie_group();
  const int n_ = type_->tangent_size();
  std::mt19937 rng_{3};
};
INSTANTIATE_TEST_SUITE_P(Poses, Recover, testing::Bool(), [](const auto& spatial) {
  return std::string(spatial.param ? "InSpace" : "InThePlane");
});

TEST_P(Recover, MeetsTheEndExactly) {
  for (const int steps : {1, 2, 7}) {
    const OdometryChain chain = any_chain(steps);
    const State from = any(), to = any();
    for (const Recovery how : kAll) {
      const std::vector<State> poses = states(chain, from, to, how);
      ASSERT_THAT(poses, SizeIs(steps));
      EXPECT_EQ(poses.back(), to);
    }
  }
}

TEST_P(Recover, HasNothingToPutBackWithoutSteps) {
  for (const Recovery how : kAll) EXPECT_THAT(states(chain({}), any(), any(), how), IsEmpty());
}

TEST_P(Recover, FollowsTheMotionsWhereTheEndsAgreeWithThem) {
  const OdometryChain chain = any_chain(6);
  const State from = any();
  std::vector<State> reckoned{from};
  for (const ChainStep& step : chain.steps)
    reckoned.push_back(compose(reckoned.back(), step.motion));
  const std::vector<State> poses = states(chain, from, reckoned.back(), Recovery::distribute);
  for (std::size_t k = 0; k < poses.size(); ++k) expect_near(poses[k], reckoned[k + 1]);
}

TEST_P(Recover, StaysInTheGroupOverManySteps) {
  for (const State& pose : states(any_chain(1000), any(), any(), Recovery::distribute)) {
    State canonical = pose;
    EXPECT_EQ(type_->normalize(canonical.data()), "");
    EXPECT_EQ(pose, canonical);
  }
}

TEST_P(Recover, DoesNotDependOnWhereTheWorldIs) {
  const OdometryChain chain = any_chain(4);
  const State from = any(), to = any(), shift = any();
  for (const Recovery how : kAll) {
    const auto here = states(chain, from, to, how),
               there = states(chain, compose(shift, from), compose(shift, to), how);
    for (std::size_t k = 0; k < here.size(); ++k) expect_near(there[k], compose(shift, here[k]));
  }
}

TEST_P(Recover, SharesAStraightLineEvenlyOrByDistance) {
  const OdometryChain line = chain({arc(1, 0), arc(2, 0), arc(1, 0)});
  const State from = at(5, 0, 0), to = at(11, 0, 0);
  const auto even = states(line, from, to, Recovery::uniform);
  expect_near(even[0], at(7, 0, 0));
  expect_near(even[1], at(9, 0, 0));
  for (const Recovery how : {Recovery::interpolate, Recovery::distribute}) {
    const auto by_distance = states(line, from, to, how);
    expect_near(by_distance[0], at(6.5, 0, 0));
    expect_near(by_distance[1], at(9.5, 0, 0));
  }
}

// A quarter of a circle of radius 2 about (0, 2), and a third of it.
TEST_P(Recover, GoesAlongTheArcBetweenTheEnds) {
  const OdometryChain two = chain({arc(1, 0), arc(2, 0)});
  const State from = at(0, 0, 0), to = at(2, 2, kRight);
  const double half = kRight / 2, third = kRight / 3;
  expect_near(states(two, from, to, Recovery::uniform)[0],
              at(2 * std::sin(half), 2 - 2 * std::cos(half), half));
  expect_near(states(two, from, to, Recovery::interpolate)[0],
              at(2 * std::sin(third), 2 - 2 * std::cos(third), third));
}

// One metre ahead and a quarter turn to the left, two metres ahead: that ends at (1, 2). It was (1,
// 5), so three metres further ahead, which is distributed by the norms of both steps.
TEST_P(Recover, SpreadsTheMismatchOverTheMotions) {
  const OdometryChain turn = chain({at(1, 0, kRight), at(2, 0, 0)});
  const auto poses = states(turn, at(0, 0, 0), at(1, 5, kRight), Recovery::distribute);
  const double first = std::hypot(1.0, kRight);
  expect_near(poses[0], at(1, 3 * first / (first + 2), kRight));
}

TEST_P(Recover, CountsTurningOnTheSpotAsMotion) {
  const OdometryChain turning = chain({at(0, 0, 0.4), at(0, 0, 0.0), at(0, 0, 0.2), at(0, 0, 0.2)});
  const State from = at(1, 1, 0), to = at(1, 1, 1.2);
  const auto even = states(turning, from, to, Recovery::uniform);
  expect_near(even[0], at(1, 1, 0.3));
  expect_near(even[2], at(1, 1, 0.9));
  // 0.8 turned, not 1.2.
  for (const Recovery how : {Recovery::interpolate, Recovery::distribute}) {
    const auto spread = states(turning, from, to, how);
    expect_near(spread[0], at(1, 1, 0.6));
    expect_near(spread[1], at(1, 1, 0.6));
    expect_near(spread[2], at(1, 1, 0.9));
  }
}

TEST_P(Recover, CountsStepsWhereNothingMoves) {
  const OdometryChain still = chain({at(0, 0, 0), at(0, 0, 0), at(0, 0, 0)});
  const State from = at(1, 1, 0), to = at(4, 1, 0);
  for (const Recovery how : {Recovery::uniform, Recovery::interpolate, Recovery::distribute}) {
    const auto spread = states(still, from, to, how);
    expect_near(spread[0], at(2, 1, 0));
    expect_near(spread[1], at(3, 1, 0));
  }
}

// From a pose that was matched 5 m beside the first, round a square to one that was matched 5 m
// beside the last: as between these two, whatever lies between the ends.
TEST_P(Recover, GoesBetweenThePosesThatWereMatched) {
  OdometryChain matched =
      chain({at(0, 5, 0), at(1, 0, 0), at(2, 0, 0), at(1, 0, 0), at(3, -4, kRight)});
  matched.steps.front().matched = true;
  matched.steps.back().matched = true;
  const State from = at(0, 0, 0), to = at(11, 1, kRight);  // the way has 8 m instead of 4
  const auto even = states(matched, from, to, Recovery::uniform);
  ASSERT_THAT(even, SizeIs(5));
  expect_near(even[0], at(0, 5, 0));
  expect_near(even[1], at(8.0 / 3, 5, 0));
  expect_near(even[3], at(8, 5, 0));
  EXPECT_EQ(even[4], to);
  for (const Recovery how : {Recovery::interpolate, Recovery::distribute}) {
    const auto poses = states(matched, from, to, how);
    expect_near(poses[0], at(0, 5, 0));
    expect_near(poses[1], at(2, 5, 0));
    expect_near(poses[2], at(6, 5, 0));
    expect_near(poses[3], at(8, 5, 0));
    EXPECT_EQ(poses[4], to);
  }
  OdometryChain nothing_else = chain({at(1, 0, 0)});
  nothing_else.steps.front().matched = true;
  EXPECT_THAT(states(nothing_else, from, to, Recovery::interpolate), testing::ElementsAre(to));
}

// Steps of ξ_k on top of the motions, which are as likely as can be and, to first order, lead to
// the end: ξ = S Aᵀ (A S Aᵀ)⁻¹ d with S their covariances and A_k = Ad((z_{k+1} ⋯ z_q)⁻¹).
TEST_P(Recover, FindsTheLikeliestWay) {
  constexpr int kSteps = 4;
  const OdometryChain chain = with_covariances(any_chain(kSteps));
  State rest = exp(Eigen::VectorXd::Zero(n_));
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(kSteps * n_, kSteps * n_), A(n_, kSteps * n_);
  for (int k = kSteps - 1; k >= 0; --k) {
    const ChainStep& step = chain.steps[static_cast<std::size_t>(k)];
    State inverse = rest;
    group_.inverse(rest.data(), inverse.data());
    group_.adjoint(inverse.data(), A.data() + n_ * n_ * k);
    S.block(n_ * k, n_ * k, n_, n_) =
        Eigen::Map<const Eigen::MatrixXd>(step.covariance.data(), n_, n_);
    rest = compose(step.motion, rest);
  }
  const State from = any();
  const Eigen::VectorXd d = 1e-5 * Eigen::VectorXd::Ones(n_);
  const Eigen::VectorXd xi = S * A.transpose() * (A * S * A.transpose()).llt().solve(d);
  const auto poses = states(chain, from, compose(compose(from, rest), exp(d)), Recovery::likely);
  State expected = from;
  for (int k = 0; k < kSteps; ++k) {
    expected = compose(expected, chain.steps[static_cast<std::size_t>(k)].motion);
    EXPECT_GT(distance(expected, poses[static_cast<std::size_t>(k)]), 1e-6);
    expected = compose(expected, exp(xi.segment(n_ * k, n_)));
    EXPECT_LT(distance(expected, poses[static_cast<std::size_t>(k)]), 1e-8);
  }
}

TEST_P(Recover, MeetsTheEndExactlyOnTheLikeliestWayToo) {
  const State to = any();
  EXPECT_EQ(states(with_covariances(any_chain(3)), any(), to, Recovery::likely).back(), to);
}

TEST_P(Recover, RefusesWhatDoesNotFit) {
  const State from = any(), to = any();
  const auto refusal = [&](const VariableType& type, const OdometryChain& chain, const State& end,
                           Recovery how = Recovery::uniform) {
    try {
      recover(type, chain, from, end, how);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      return std::string(error.what());
    }
    return std::string();
  };
  const OdometryChain one = chain({arc(1, 0)});
  EXPECT_THAT(refusal(*define_variable<test::ScaledPose>(), one, to),
              HasSubstr("VERTEX_SCALED lacks the ability LieGroup or Placement"));
  EXPECT_THAT(refusal(*type_, one, State{1.0}), HasSubstr("numbers"));
  EXPECT_THAT(refusal(*type_, chain({State{1.0}}), to), HasSubstr("numbers"));
  EXPECT_EQ(refusal(*type_, one, to), "");
  EXPECT_THAT(refusal(*type_, one, to, Recovery::likely),
              HasSubstr("needs the covariance of every step, and that to pose 11 has none"));
}

}  // namespace
}  // namespace cairn
