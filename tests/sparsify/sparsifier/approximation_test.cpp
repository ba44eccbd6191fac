// SPDX-License-Identifier: BSD-3-Clause
// The one formula of factor descent, against the three propositions of the thesis and against the
// definition of the cost.
#include "approximation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "sparsify/sparsifier/blankets.hpp"
#include "sparsify/sparsifier/problems.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Ge;
using testing::Gt;
using testing::Le;
using testing::Lt;

/// Problems of every kind: residuals of 3 and 6, Jacobians that are full or of pairs of nodes.
template <class F>
void for_problems(int times, const F& test) {
  for (int seed = 0; seed < times; ++seed) {
    Draw draw(static_cast<unsigned>(seed));
    for (const int m : {3, 6}) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", m = " << m);
      const int r = 9 + draw.integer(22);
      test(full_problem(draw, m, r, r / m + 2 + draw.integer(4)), draw);
      const int nodes = 4 + draw.integer(m == 3 ? 7 : 3);
      test(pairwise_problem(draw, m, nodes, 1 + draw.integer(nodes)), draw);
    }
  }
}

std::vector<Matrix> unscaled(const ScaledProblem& scaled, const std::vector<Matrix>& W) {
  std::vector<Matrix> Omega;
  for (int k = 0; k < scaled.factors(); ++k) Omega.push_back(scaled.information(k, W[k]));
  return Omega;
}

/// Φ = (J Jᵀ)⁻¹, the optimum of a factor by itself.
Matrix Phi_of(const Matrix& J) { return (J * J.transpose()).inverse(); }

/// 2 KLD but for what does not change with the W of factor k.
class FactorCost {
 public:
  FactorCost(const Approximation& at, int k)
      : Q_(at.problem().Q[k]), Upsilon_(Matrix::Zero(at.problem().rank, at.problem().rank)) {
    for (int j = 0; j < at.problem().factors(); ++j) {
      const Matrix& Q = at.problem().Q[j];
      if (j != k) Upsilon_ += Q.transpose() * at.W(j) * Q;
    }
  }
  double operator()(const Matrix& W) const {
    return W.trace() - log_determinant_of(Upsilon_ + Q_.transpose() * W * Q_);
  }
  const Matrix& Upsilon() const { return Upsilon_; }

 private:
  Matrix Q_, Upsilon_;
};

TEST(ScaledProblem, EachFactorAloneWouldBeTheIdentity) {
  for_problems(5, [](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    for (int k = 0; k < scaled.factors(); ++k) {
      const int m = scaled.size(k);
      const Matrix I = Matrix::Identity(m, m);
      const Matrix J = jacobian(problem.factors[k], problem.rank);
      EXPECT_THAT(apart(scaled.Q[k] * scaled.Q[k].transpose(), I), Lt(1e-10));
      EXPECT_THAT(apart(scaled.information(k, I), Phi_of(J)), Lt(1e-10));
      const Matrix Omega = draw.definite(m);
      EXPECT_THAT(apart(scaled.information(k, scaled.scaled(k, Omega)), Omega), Lt(1e-10));
    }
  });
}

TEST(ScaledProblem, RefusesAFactorThatMeasuresOneThingTwice) {
  Draw draw(1);
  Matrix J = draw.matrix(3, 6);
  J.row(2) = J.row(0) - 2.0 * J.row(1);
  RecoveryProblem problem{.rank = 6, .factors = {}};
  add_factor(problem, J);
  try {
    const ScaledProblem scaled(problem);
    FAIL() << "it was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::numerical);
  }
}

TEST(NearestPositive, IsNearerThanAnyOther) {
  Draw draw(3);
  for (int times = 0; times < 20; ++times) {
    const Matrix A = draw.matrix(4, 4);
    const Matrix P = nearest_positive(A, 0.0);
    EXPECT_THAT(least_eigenvalue(P), Ge(-1e-12));
    EXPECT_THAT(apart(P, P.transpose()), Lt(1e-12));
    for (int k = 0; k < 100; ++k) {
      const Matrix B = draw.matrix(4, 4);
      const double size = draw.uniform(0.0, 1.0);
      EXPECT_THAT((A - P).norm(), Le((A - (1.0 - size) * P - size * B * B.transpose()).norm()));
    }
    const Matrix D = draw.definite(4);
    EXPECT_THAT(apart(nearest_positive(D), D), Lt(1e-12));
  }
}

TEST(Approximation, SaysWhatTheDefinitionDoes) {
  for_problems(10, [](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    const std::vector<Matrix> W = random_weights(draw, scaled);
    ASSERT_TRUE(at.set(W));
    const Matrix L = approximated(problem, unscaled(scaled, W));
    EXPECT_THAT(at.kld(), DoubleNear(dense_kld(L), 1e-9 * (1.0 + at.kld())));
    EXPECT_THAT(apart(at.V(), scaled.T * L.inverse() * scaled.T.transpose()), Lt(1e-9));
    for (int k = 0; k < scaled.factors(); ++k)
      EXPECT_THAT(apart(at.M(k), scaled.Q[k] * L.inverse() * scaled.Q[k].transpose()), Lt(1e-9));
  });
}

TEST(Approximation, ManyChangesAreOneSet) {
  for_problems(10, [](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled), fresh(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled)));
    for (int times = 0; times < 200; ++times) {
      const int k = draw.integer(scaled.factors());
      at.change(k, draw.uniform(0.3, 1.0) * draw.definite(scaled.size(k)));
    }
    ASSERT_TRUE(fresh.set(at.W()));
    EXPECT_THAT(at.kld(), DoubleNear(fresh.kld(), 1e-9));
    EXPECT_THAT(apart(at.V(), fresh.V()), Lt(1e-9));
    for (int k = 0; k < scaled.factors(); ++k) EXPECT_THAT(apart(at.M(k), fresh.M(k)), Lt(1e-9));
  });
}

// A factor that says which few columns of a basis it measures is the same factor.
TEST(Approximation, IsTheSameByColumns) {
  cairn::Registry registry;
  Draw draw(8);
  for (const int dimension : {2, 3}) {
    const DenseBlanket blanket = random_blanket(registry, dimension, 7, draw, 7);
    for (const Projection how : {Projection::node, Projection::eigen}) {
      const RecoveryProblem by_columns =
          BlanketProjection(blanket, how).problem(blanket, every_model(blanket));
      ASSERT_FALSE(by_columns.basis.empty());
      RecoveryProblem dense = by_columns;
      dense.basis.clear();
      const ScaledProblem scaled_by_columns(by_columns), scaled(dense);
      Approximation at(scaled_by_columns), reference(scaled), few(scaled_by_columns);
      const std::vector<Matrix> W = random_weights(draw, scaled);
      ASSERT_TRUE(at.set(W) && reference.set(W) && few.set(W));
      few.follow({0, 3});
      for (int times = 0; times < 50; ++times) {
        const int k = draw.integer(2) * 3;
        const Matrix change = draw.uniform(0.3, 1.0) * draw.definite(scaled.size(k));
        for (Approximation* each : {&at, &reference, &few}) each->change(k, change);
      }
      EXPECT_THAT(apart(few.M(3), reference.M(3)), Lt(1e-8));
      few.follow_all();
      EXPECT_THAT(at.kld(), DoubleNear(reference.kld(), 1e-8));
      for (int k = 0; k < scaled.factors(); ++k) {
        EXPECT_THAT(apart(at.M(k), reference.M(k)), Lt(1e-8));
        EXPECT_THAT(apart(few.M(k), reference.M(k)), Lt(1e-8));
      }
    }
  }
}

TEST(Approximation, RefusesToBeSingular) {
  Draw draw(2);
  RecoveryProblem problem{.rank = 7, .factors = {}};
  add_factor(problem, draw.matrix(3, 7));
  add_factor(problem, draw.matrix(3, 7));
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  EXPECT_FALSE(at.set({Matrix::Identity(3, 3), Matrix::Identity(3, 3)}));
}

/// Proposition 2 (T 4.13), where the others determine everything and leave something to say.
TEST(Approximation, BestIsProposition2WhereTheOthersSayLittle) {
  int seen = 0;
  for_problems(25, [&](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled, 0.2)));
    const std::vector<Matrix> Omega = unscaled(scaled, at.W());
    for (int k = 0; k < scaled.factors(); ++k) {
      const Matrix Upsilon = approximated(problem, Omega, k);
      if (least_eigenvalue(Upsilon) < 1e-4) continue;
      const Matrix J = jacobian(problem.factors[k], problem.rank);
      const Matrix expected = Phi_of(J) - Matrix(J * Upsilon.inverse() * J.transpose()).inverse();
      if (least_eigenvalue(scaled.scaled(k, expected)) < 1e-3) continue;
      ++seen;
      EXPECT_THAT(apart(scaled.information(k, at.best(k).W), expected), Lt(1e-8));
    }
  });
  EXPECT_THAT(seen, Gt(200));
}

/// Proposition 3 (T 4.15): nobody else measures what the edge of a tree does.
TEST(Approximation, BestIsProposition3InATree) {
  for (int seed = 0; seed < 20; ++seed) {
    Draw draw(static_cast<unsigned>(seed));
    for (const int m : {3, 6}) {
      const RecoveryProblem problem = pairwise_problem(draw, m, 3 + draw.integer(3), 0);
      const ScaledProblem scaled(problem);
      Approximation at(scaled);
      ASSERT_TRUE(at.set(random_weights(draw, scaled)));
      for (int k = 0; k < scaled.factors(); ++k) {
        const Matrix J = jacobian(problem.factors[k], problem.rank);
        EXPECT_THAT(apart(scaled.information(k, at.best(k).W), Phi_of(J)), Lt(1e-8));
      }
    }
  }
}

/// J = [L 0] [Q_L; Q_0]: L of a factor's own space, and bases of that and of the rest.
struct LowerOrthogonal {
  Matrix L, Q_L, Q_0;
  explicit LowerOrthogonal(const Matrix& J) {
    const Eigen::HouseholderQR<Matrix> qr(J.transpose());
    const Eigen::Index m = J.rows(), r = J.cols();
    L = Matrix(qr.matrixQR().topRows(m).triangularView<Eigen::Upper>()).transpose();
    const Matrix Q = qr.householderQ() * Matrix::Identity(r, r);
    Q_L = Q.leftCols(m).transpose();
    Q_0 = Q.rightCols(r - m).transpose();
  }
};

/// Proposition 1 (T 4.12), where the others know a part of what the factor measures.
TEST(Approximation, BestIsProposition1WhereTheOthersKnowAPart) {
  int seen = 0;
  for (int seed = 0; seed < 60; ++seed) {
    Draw draw(static_cast<unsigned>(seed));
    const int m = seed % 2 == 0 ? 3 : 6, r = 12 + draw.integer(19),
              unknown = 1 + draw.integer(m - 1);
    RecoveryProblem problem{.rank = r, .factors = {}};
    add_factor(problem, draw.matrix(m, r));
    // In coordinates of which the others leave some out.
    const Matrix mix = Matrix::Identity(r, r) + 0.3 / std::sqrt(r) * draw.matrix(r, r);
    for (int k = 0; k < r / m + 2; ++k) {
      Matrix J = draw.matrix(m, r);
      J.leftCols(unknown).setZero();
      add_factor(problem, J * mix);
    }
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled, 0.2)));
    const Matrix Upsilon = approximated(problem, unscaled(scaled, at.W()), 0);
    ASSERT_EQ(Upsilon.fullPivLu().rank(), r - unknown);
    const Matrix J = jacobian(problem.factors[0], r);
    const LowerOrthogonal lq(J);
    ASSERT_THAT(apart(lq.L * lq.Q_L, J), Lt(1e-12));
    const Matrix across = Upsilon * lq.Q_0.transpose();
    const Matrix left = Upsilon - across * (lq.Q_0 * across).ldlt().solve(across.transpose());
    const Matrix L_inverse = lq.L.inverse();
    const Matrix expected =
        Phi_of(J) - L_inverse.transpose() * lq.Q_L * left * lq.Q_L.transpose() * L_inverse;
    if (least_eigenvalue(scaled.scaled(0, expected)) < 1e-3) continue;
    ++seen;
    EXPECT_THAT(apart(scaled.information(0, at.best(0).W), expected), Lt(1e-8)) << seed;
  }
  EXPECT_THAT(seen, Gt(25));
}

/// What the thesis does with negative eigenvalues: they become ε, in Ω's units.
Matrix clipped(const ScaledProblem& scaled, const Approximation& at, int k) {
  const int m = scaled.size(k);
  const Matrix free = Matrix::Identity(m, m) - (at.M(k).inverse() - at.W(k));
  return scaled.scaled(k, nearest_positive(scaled.information(k, free)));
}

TEST(Approximation, UnderTheConstraintBestIsBetterThanAllOthers) {
  int active = 0, better = 0;
  for_problems(6, [&](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled)));
    for (int k = 0; k < scaled.factors(); ++k) {
      const int m = scaled.size(k);
      const FactorCost cost(at, k);
      const Approximation::Best best = at.best(k);
      const double least = cost(best.W);
      if (least_eigenvalue(best.W) > 1e-6) continue;
      ++active;
      const double clip = cost(clipped(scaled, at, k));
      EXPECT_THAT(least, Le(clip + 1e-10));
      better += least < clip - 1e-6;
      for (int times = 0; times < 1000; ++times) {
        const double size = std::pow(10.0, draw.uniform(-4.0, 0.0));
        const Matrix E = draw.matrix(m, m);
        const Matrix near = nearest_positive(best.W + size * (E + E.transpose()));
        EXPECT_THAT(least, Le(cost(near) + 1e-10));
      }
    }
  });
  EXPECT_THAT(active, Gt(20));
  EXPECT_THAT(better, Gt(10));
}

/// W ⪰ ε, G ⪰ 0 and G (W − ε) = 0 with the gradient G = I − M.
TEST(Approximation, BestSatisfiesTheConditionsOfKarushKuhnAndTucker) {
  int active = 0;
  for_problems(20, [&](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled, draw.uniform(0.1, 1.5))));
    for (int times = 0; times < 10; ++times) {
      const int k = draw.integer(scaled.factors()), m = scaled.size(k);
      const Matrix I = Matrix::Identity(m, m);
      at.change(k, at.best(k).W);
      const Matrix G = I - at.M(k);
      EXPECT_THAT(least_eigenvalue(at.W(k)), Ge(kFloor * (1.0 - 1e-6)));
      EXPECT_THAT(least_eigenvalue(G), Ge(-1e-9));
      EXPECT_THAT((G * (at.W(k) - kFloor * I)).cwiseAbs().maxCoeff(), Lt(1e-9));
      active += G.cwiseAbs().maxCoeff() > 1e-6;
    }
  });
  EXPECT_THAT(active, Gt(20));
}

TEST(Approximation, GainIsWhatTheChangeGainsAndNeverAboveItsBound) {
  for_problems(20, [](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled, draw.uniform(0.1, 1.5))));
    for (int times = 0; times < 20; ++times) {
      const int k = draw.integer(scaled.factors());
      const Approximation::Best best = at.best(k);
      EXPECT_THAT(best.gain, Ge(-1e-12));
      EXPECT_THAT(at.bound(k), Ge(best.gain - 1e-12));
      const double before = at.kld();
      at.change(k, best.W);
      EXPECT_THAT(before - at.kld(), DoubleNear(best.gain, 1e-9));
      EXPECT_THAT(at.best(k).gain, DoubleNear(0.0, 1e-11));
    }
  });
}

/// Where the others say little, nothing holds a factor back, and the bound is the gain.
TEST(Approximation, BoundIsTheGainWithoutTheConstraint) {
  for_problems(5, [](const RecoveryProblem& problem, Draw& draw) {
    const ScaledProblem scaled(problem);
    Approximation at(scaled);
    ASSERT_TRUE(at.set(random_weights(draw, scaled, 0.05)));
    for (int k = 0; k < scaled.factors(); ++k) {
      const Approximation::Best best = at.best(k);
      if (least_eigenvalue(best.W) < 1e-6) continue;
      EXPECT_THAT(at.bound(k), DoubleNear(best.gain, 1e-9 * (1.0 + best.gain)));
    }
  });
}

TEST(Approximation, KeepsAFloorThatIsAskedFor) {
  Draw draw(4);
  const RecoveryProblem problem = full_problem(draw, 3, 9, 8);
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  ASSERT_TRUE(at.set(random_weights(draw, scaled)));
  for (int k = 0; k < scaled.factors(); ++k)
    EXPECT_THAT(least_eigenvalue(at.best(k, 0.25).W), Ge(0.25 - 1e-12));
}

}  // namespace
}  // namespace cairn::sparsify
