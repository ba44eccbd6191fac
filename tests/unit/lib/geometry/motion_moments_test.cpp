// SPDX-License-Identifier: BSD-3-Clause
// The covariance of a composed motion against the true second moment of log(exp(ξ₁) exp(ξ₂)).
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "cairn/geometry/motion.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_variable.hpp"
#include "support/scaled_pose.hpp"
#include "unit/lib/geometry/motions.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::HasSubstr;

/// Nodes and weights of Gauss and Hermite's rule for the standard normal distribution (by Golub and
/// Welsch): exact for polynomials up to degree 2 points − 1.
struct Rule {
  explicit Rule(int points) {
    MatrixXd J = MatrixXd::Zero(points, points);
    for (int k = 1; k < points; ++k) J(k, k - 1) = J(k - 1, k) = std::sqrt(double(k));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(J);
    nodes = eigen.eigenvalues();
    weights = eigen.eigenvectors().row(0).cwiseAbs2().transpose();
  }
  VectorXd nodes, weights;
};

/// E[ξ ξᵀ], ξ = log(exp(L₁ u) exp(L₂ v)), u and v standard normal.
MatrixXd second_moment(const VariableType& type, const MatrixXd& L_1, const MatrixXd& L_2,
                       const Rule& rule) {
  const auto dimensions = L_1.cols() + L_2.cols(), points = rule.nodes.size();
  std::vector<double> a(static_cast<std::size_t>(type.ambient_size())), b = a;
  std::vector<Eigen::Index> at(static_cast<std::size_t>(dimensions), 0);
  MatrixXd sum = MatrixXd::Zero(L_1.rows(), L_1.rows());
  VectorXd u(dimensions), xi(L_1.rows());
  for (std::size_t digit = 0; digit < at.size();) {
    double weight = 1.0;
    for (std::size_t k = 0; k < at.size(); ++k) {
      u[static_cast<Eigen::Index>(k)] = rule.nodes[at[k]];
      weight *= rule.weights[at[k]];
    }
    type.lie_group()->exp((L_1 * u.head(L_1.cols())).eval().data(), a.data());
    type.lie_group()->exp((L_2 * u.tail(L_2.cols())).eval().data(), b.data());
    type.lie_group()->compose(a.data(), b.data(), a.data());
    type.lie_group()->log(a.data(), xi.data());
    sum += weight * xi * xi.transpose();
    for (digit = 0; digit < at.size() && ++at[digit] == points; ++digit) at[digit] = 0;
  }
  return sum;
}

// Three points are exact for terms of fourth order; and what is added by them is linear in Σ₁ and
// in Σ₂, so that noise in any three directions each will do.
TEST_P(MotionGroupTest, HasAllTermsOfFourthOrder) {
  const MatrixXd L_1 = sampler_.matrix(n_, 3), L_2 = sampler_.matrix(n_, 3);
  const Rule rule(3);
  const auto miss = [&](double sigma, CompositionOrder order) {
    const Motion ab = group_.compose(at_rest(sigma * L_1), at_rest(sigma * L_2), order);
    return (covariance(ab) - second_moment(type_, sigma * L_1, sigma * L_2, rule)).norm();
  };
  // What is missing falls with the fourth power of the noise, or with the sixth.
  EXPECT_NEAR(miss(0.02, CompositionOrder::first) / miss(0.01, CompositionOrder::first), 16.0, 0.1);
  EXPECT_NEAR(miss(0.04, CompositionOrder::fourth) / miss(0.02, CompositionOrder::fourth), 64.0,
              1.0);
}

TEST_P(MotionGroupTest, IsCloserToTheTruthByFourthOrderWhereNoiseIsLarge) {
  const Rule rule(5);
  for (int k = 0; k < 3; ++k) {
    const MatrixXd L_1 = 0.25 * sampler_.matrix(n_, 3), L_2 = 0.25 * sampler_.matrix(n_, 3);
    const MatrixXd truth = second_moment(type_, L_1, L_2, rule);
    const Motion a = at_rest(L_1), b = at_rest(L_2);
    const double first = (covariance(group_.compose(a, b)) - truth).norm(),
                 fourth =
                     (covariance(group_.compose(a, b, CompositionOrder::fourth)) - truth).norm();
    EXPECT_GT(first, 0.005 * truth.norm());
    EXPECT_LT(fourth, 0.2 * first);
  }
}

// Σ as the header has it, with the group's own ad.
TEST_P(MotionGroupTest, FindsTheStructureConstants) {
  const Motion a = sampler_.motion(type_, 0.5), b = sampler_.motion(type_, 0.5);
  std::vector<double> back(a.mean.size());
  MatrixXd A(n_, n_);
  type_.lie_group()->inverse(b.mean.data(), back.data());
  type_.lie_group()->adjoint(back.data(), A.data());
  const MatrixXd S_1 = A * covariance(a) * A.transpose(), S_2 = covariance(b);
  MatrixXd P_1 = MatrixXd::Zero(n_, n_), P_2 = P_1, B = P_1;
  for (int j = 0; j < n_; ++j) {
    for (int k = 0; k < n_; ++k) {
      const MatrixXd ad_j = ad(VectorXd::Unit(n_, j)), ad_k = ad(VectorXd::Unit(n_, k));
      P_1 += S_1(j, k) * ad_j * ad_k;
      P_2 += S_2(j, k) * ad_j * ad_k;
      B += S_1(j, k) * ad_j * S_2 * ad_k.transpose();
    }
  }
  const MatrixXd C = P_1 * S_2 + P_2 * S_1;
  const MatrixXd expected = S_1 + S_2 + 0.25 * B + (C + C.transpose()) / 12.0;
  EXPECT_GT((expected - S_1 - S_2).norm(), 0.01 * expected.norm());
  EXPECT_LT((covariance(group_.compose(a, b, CompositionOrder::fourth)) - expected).norm(),
            1e-13 * expected.norm());
}

// exp(s ξ) exp(t ξ) = exp((s + t) ξ): ad(ξ) ξ = 0, so that ad(ξ) η = −ad(η) ξ.
TEST_P(MotionGroupTest, HasNothingToAddWhereMotionsCommute) {
  for (int k = 0; k < 10; ++k) {
    const VectorXd xi = sampler_.vector(n_);
    const Motion a = at_rest(2.0 * xi), b = at_rest(3.0 * xi);
    expect_same(group_, group_.compose(a, b, CompositionOrder::fourth),
                at_rest(std::sqrt(13.0) * xi), 1e-12);
  }
}

TEST(MotionGroupOfPoints, IsAdditionToAnyOrder) {
  const MotionGroup group(define_variable<PointXYZ>());
  MotionSampler sampler(8);
  const Motion a = sampler.motion(group.type(), 2.0), b = sampler.motion(group.type(), 2.0);
  for (const CompositionOrder order : {CompositionOrder::first, CompositionOrder::fourth}) {
    const Motion ab = group.compose(a, b, order);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(ab.mean[k], a.mean[k] + b.mean[k]);
    EXPECT_LT((covariance(ab) - covariance(a) - covariance(b)).norm(), 1e-14);
  }
}

TEST(MotionGroup, RefusesWhatIsNoGroup) {
  try {
    MotionGroup group(define_variable<ScaledPose>());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_SCALED forms no Lie group"));
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_SE2"));
  }
}

}  // namespace
}  // namespace cairn::test
