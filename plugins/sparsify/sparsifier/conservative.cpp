// SPDX-License-Identifier: BSD-3-Clause
#include "conservative.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {
namespace {

constexpr int kRounds = 30;
/// A round that gains less ends them [nats].
constexpr double kLeastGain = 1e-5;
/// Λ̆ stays this far below Λ meanwhile, so that D is invertible.
constexpr double kInside = 1e-6;

/// Λ̆ in coordinates in which Λ = I.
Matrix information_of(const Approximation& at) {
  const ScaledProblem& problem = at.problem();
  Matrix L = Matrix::Zero(problem.rank, problem.rank);
  for (int k = 0; k < problem.factors(); ++k)
    dense::add_product_of_transpose(problem.Q[k], dense::product(at.W(k), problem.Q[k]), L);
  return L;
}

void divide_by_largest(Approximation& at, double inside) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(information_of(at));
  const double largest = eigen.eigenvalues()[at.problem().rank - 1];
  if (largest <= 1.0 - inside) return;
  std::vector<Matrix> W = at.W();
  for (Matrix& of_one : W) of_one *= (1.0 - inside) / largest;
  at.set(std::move(W));
}

/// The W of a factor that lowers the cost, between the one that it has and its optimum cut to
/// W ⪯ U; empty if none does.
Matrix better(const Approximation& at, int k, const Matrix& U, double& gained) {
  const Eigen::LLT<Matrix> llt(U);
  if (llt.info() != Eigen::Success) return {};
  const Matrix half = llt.matrixL().solve(at.best(k).W);
  const Matrix unit = llt.matrixL().solve(Matrix(half.transpose()));
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(Matrix(0.5 * (unit + unit.transpose())));
  const Matrix cut =
      dense::from_eigenvalues(eigen.eigenvectors(), eigen.eigenvalues().cwiseMin(1.0 - kInside));
  const Matrix L = llt.matrixL();
  const Matrix change = dense::congruent(L, cut) - at.W(k);
  const Eigen::Index m = U.rows();
  double most = 0.0, part = 0.0;
  for (const double step : {1.0, 0.5, 0.25, 0.125}) {
    // 2 KLD changes by tr E − ln |I + E M|.
    const Matrix sum = Matrix::Identity(m, m) + step * dense::product(change, at.M(k));
    const double determinant = Eigen::PartialPivLU<Matrix>(sum).determinant();
    const double gain =
        determinant > 0.0 ? 0.5 * (std::log(determinant) - step * change.trace()) : 0.0;
    if (gain > most) {
      most = gain;
      part = step;
    }
  }
  if (most <= 0.0) return {};
  gained += most;
  return at.W(k) + part * change;
}

}  // namespace

void make_conservative(Approximation& at) {
  const ScaledProblem& problem = at.problem();
  divide_by_largest(at, kInside);
  Matrix rest = Matrix::Identity(problem.rank, problem.rank) - information_of(at);
  for (int round = 0; round < kRounds; ++round) {
    double gained = 0.0;
    for (int k = 0; k < problem.factors(); ++k) {
      const Matrix& Q = problem.Q[k];
      Matrix D = rest;
      dense::add_product_of_transpose(Q, dense::product(at.W(k), Q), D);
      const Eigen::LLT<Matrix> llt(D);
      if (llt.info() != Eigen::Success) continue;
      const Matrix DQ = llt.solve(Matrix(Q.transpose()));
      const Matrix U = dense::product(Q, DQ).inverse();
      const Matrix W = better(at, k, 0.5 * (U + U.transpose()), gained);
      if (W.size() == 0) continue;
      rest = D;
      rest -= dense::congruent_of_transpose(Q, W);
      at.change(k, W);
    }
    if (gained < kLeastGain) break;
  }
  at.refresh();
  divide_by_largest(at, 0.0);
}

}  // namespace cairn::sparsify
