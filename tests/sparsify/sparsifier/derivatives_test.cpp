// SPDX-License-Identifier: BSD-3-Clause
// The cost's gradient, against automatic differentiation of its definition.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "approximation.hpp"
#include "cairn/pack/dual.hpp"
#include "recovery.hpp"
#include "sparsify/sparsifier/problems.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Ge;
using testing::Le;

constexpr int kFactors = 4, kSize = 3, kEntries = kFactors * kSize * kSize;
template <class S>
using MatrixOf = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
using Number = Dual<kEntries>;

/// ln |A| by elimination without pivots, which a positive definite matrix does not need.
template <class S>
S log_determinant(MatrixOf<S> A) {
  using std::log;
  S sum = 0.0;
  for (Eigen::Index k = 0; k < A.rows(); ++k) {
    sum += log(A(k, k));
    for (Eigen::Index i = k + 1; i < A.rows(); ++i) {
      const S factor = A(i, k) / A(k, k);
      for (Eigen::Index j = k + 1; j < A.rows(); ++j) A(i, j) -= factor * A(k, j);
    }
  }
  return sum;
}

/// 2 KLD by all elements of all W, each by itself.
Number differentiated(const ScaledProblem& problem, const std::vector<Matrix>& W) {
  const int r = problem.rank;
  MatrixOf<Number> L = MatrixOf<Number>::Zero(r, r);
  Number trace = 0.0;
  for (int k = 0, entry = 0; k < kFactors; ++k) {
    MatrixOf<Number> variable(kSize, kSize);
    for (int a = 0; a < kSize; ++a) {
      for (int b = 0; b < kSize; ++b) variable(a, b) = Number::variable(W[k](a, b), entry++);
      trace += variable(a, a);
    }
    const MatrixOf<Number> Q = problem.Q[k].cast<Number>();
    const MatrixOf<Number> WQ = variable * Q;
    L += Q.transpose() * WQ;
  }
  return trace - log_determinant(L) - static_cast<double>(r);
}

TEST(Derivatives, TheGradientIsIdentityMinusM) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Draw draw(seed);
    const RecoveryProblem problem = seed % 2 == 0
                                        ? full_problem(draw, kSize, 6 + draw.integer(6), kFactors)
                                        : pairwise_problem(draw, kSize, 4, kFactors - 3);
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled)));
    const Number cost = differentiated(scaled, at.W());
    EXPECT_THAT(2.0 * at.kld(), DoubleNear(cost.value, 1e-9));
    for (int k = 0, entry = 0; k < kFactors; ++k) {
      for (int a = 0; a < kSize; ++a) {
        for (int b = 0; b < kSize; ++b)
          EXPECT_THAT((a == b) - at.M(k)(a, b), DoubleNear(cost.gradient[entry++], 1e-9));
      }
    }
  }
}

/// What a recovery says about its gradient is what the definition says where it ended.
TEST(Derivatives, TheReportedGradientIsTheProjectedOne) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Draw draw(seed);
    const RecoveryProblem problem = full_problem(draw, kSize, 9, kFactors);
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled)));
    const Number cost = differentiated(scaled, at.W());
    double most = 0.0;
    for (int k = 0, entry = 0; k < kFactors; ++k) {
      Matrix gradient(kSize, kSize);
      for (int a = 0; a < kSize; ++a) {
        for (int b = 0; b < kSize; ++b) gradient(a, b) = cost.gradient[entry++];
      }
      const Matrix moved = nearest_positive(at.W(k) - gradient, 0.0);
      most = std::max(most, 0.5 * (at.W(k) - moved).cwiseAbs().maxCoeff());
    }
    EXPECT_THAT(at.gradient(), DoubleNear(most, 1e-8));
  }
}

/// Newton's method with the right Hessian is there in a few dozen steps, and where it ends the
/// definition's gradient G satisfies G ⪰ 0 and G W = 0.
TEST(Derivatives, NewtonEndsInFewStepsAtAStationaryPoint) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    Draw draw(seed);
    const RecoveryProblem problem = seed % 2 == 0
                                        ? full_problem(draw, kSize, 6 + draw.integer(6), kFactors)
                                        : pairwise_problem(draw, kSize, 4, kFactors - 3);
    const RecoveryResult result = InteriorPoint({.recovery = {.tolerance = 1e-5}}).recover(problem);
    EXPECT_TRUE(result.converged);
    EXPECT_THAT(result.iterations, Le(60));
    const ScaledProblem scaled(problem);
    std::vector<Matrix> W;
    for (int k = 0; k < kFactors; ++k) W.push_back(scaled.scaled(k, information(result, k, kSize)));
    const Number cost = differentiated(scaled, W);
    for (int k = 0, entry = 0; k < kFactors; ++k) {
      Matrix gradient(kSize, kSize);
      for (int a = 0; a < kSize; ++a) {
        for (int b = 0; b < kSize; ++b) gradient(a, b) = cost.gradient[entry++];
      }
      EXPECT_THAT(least_eigenvalue(gradient), Ge(-1e-5));
      EXPECT_THAT((gradient * W[k]).cwiseAbs().maxCoeff(), Le(1e-5));
    }
  }
}

}  // namespace
}  // namespace cairn::sparsify
