// SPDX-License-Identifier: BSD-3-Clause
#include "approximation.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {
namespace {

using Eigen::Dynamic;

/// Σ (x − ln x − 1) over the eigenvalues of the inverse of M.
template <int m>
double excess(const Matrix& M) {
  const Eigen::Matrix<double, m, m> fixed = M;
  const Eigen::Matrix<double, m, m> inverse = fixed.inverse();
  return inverse.trace() + std::log(std::max(fixed.determinant(), 1e-300)) -
         static_cast<double>(M.rows());
}

template <int m>
Approximation::Best best_of(const Matrix& M_given, const Matrix& W_given, double floor) {
  using Fixed = Eigen::Matrix<double, m, m>;
  const Fixed M = M_given, W = W_given;
  const Fixed X = M.inverse();
  Fixed B = X - W;
  B = (0.5 * (B + B.transpose())).eval();
  Eigen::SelfAdjointEigenSolver<Fixed> eigen(B);
  const auto& beta = eigen.eigenvalues();
  Eigen::Matrix<double, m, 1> weights(beta.size());
  double least = 0.0;
  for (Eigen::Index i = 0; i < beta.size(); ++i) {
    weights[i] = std::max(1.0 - beta[i], floor);
    const double x = beta[i] + weights[i];
    least += x - std::log(x);
  }
  const double now = X.trace() + std::log(std::max(M.determinant(), 1e-300));
  return {eigen.eigenvectors() * weights.asDiagonal() * eigen.eigenvectors().transpose(),
          0.5 * (now - least)};
}

/// Of a singular matrix rounding may leave pivots that are positive: what is left of a diagonal
/// element once the others are eliminated is then next to nothing of it.
bool singular(const Matrix& A, const Eigen::LLT<Matrix>& llt) {
  return (llt.matrixLLT().diagonal().array().square() < 1e-13 * A.diagonal().array()).any();
}

}  // namespace

ScaledProblem::ScaledProblem(const RecoveryProblem& problem) : rank(problem.rank) {
  for (const RecoveryProblem::Factor& factor : problem.factors) {
    const Matrix J = Eigen::Map<const Matrix>(factor.jacobian.data(), factor.size, problem.rank);
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(dense::product_with_transpose(J, J));
    if (!(eigen.eigenvalues()[0] > 1e-14 * eigen.eigenvalues()[factor.size - 1]))
      throw Error(ErrorCode::numerical, "a factor of the topology measures one thing twice");
    Phi_root.push_back(eigen.operatorInverseSqrt());
    Q.push_back(dense::product(Phi_root.back(), J));
  }
  background = Matrix::Zero(rank, rank);
  if (!problem.background.empty())
    background = Eigen::Map<const Matrix>(problem.background.data(), rank, rank);
  if (problem.basis.empty()) {
    T = Matrix::Identity(rank, rank);
    A = Q;
    columns.resize(Q.size(), std::vector<int>(static_cast<std::size_t>(rank)));
    for (std::vector<int>& all : columns) std::iota(all.begin(), all.end(), 0);
    return;
  }
  T = Eigen::Map<const Matrix>(problem.basis.data(), std::ssize(problem.basis) / rank, rank);
  for (std::size_t k = 0; k < problem.factors.size(); ++k) {
    const RecoveryProblem::Factor& factor = problem.factors[k];
    columns.push_back(factor.columns);
    A.push_back(
        dense::product(Phi_root[k], Eigen::Map<const Matrix>(factor.in_columns.data(), factor.size,
                                                             std::ssize(factor.columns))));
  }
}

Matrix ScaledProblem::scaled(int k, const Matrix& information) const {
  const Matrix root = Phi_root[k].inverse();
  return dense::product(dense::product(root, information), root);
}

void refuse_background(const RecoveryProblem& problem, const char* method) {
  if (problem.background.empty()) return;
  throw Error(ErrorCode::usage,
              fmt::format("{} does not solve problems that take account of the rest of the graph "
                          "(sparsify:fit=graph): take ncfd or fd",
                          method));
}

Matrix nearest_positive(const Matrix& A, double floor) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(Matrix(0.5 * (A + A.transpose())));
  return dense::from_eigenvalues(eigen.eigenvectors(), eigen.eigenvalues().cwiseMax(floor));
}

Approximation::Approximation(const ScaledProblem& problem)
    : problem_(&problem), M_(problem.Q.size()), followed_(problem.Q.size()) {
  std::iota(followed_.begin(), followed_.end(), 0);
}

bool Approximation::set(std::vector<Matrix> W) {
  W_ = std::move(W);
  return refresh();
}

bool Approximation::refresh() {
  const int r = problem_->rank;
  Matrix L = problem_->background;
  trace_ = L.trace();
  for (int k = 0; k < problem_->factors(); ++k) {
    const Matrix WQ = dense::product(W_[k], problem_->Q[k]);
    dense::add_product_of_transpose(problem_->Q[k], WQ, L);
    trace_ += W_[k].trace();
  }
  const Eigen::LLT<Matrix> llt(L);
  if (llt.info() != Eigen::Success || singular(L, llt)) return false;
  log_determinant_ = 2.0 * llt.matrixLLT().diagonal().array().log().sum();
  V_ = dense::congruent(problem_->T, llt.solve(Matrix::Identity(r, r)));
  follow_all();
  return true;
}

void Approximation::follow(std::vector<int> factors) { followed_ = std::move(factors); }

void Approximation::follow_all() {
  followed_.resize(problem_->Q.size());
  std::iota(followed_.begin(), followed_.end(), 0);
  for (const int k : followed_) {
    const std::vector<int>& columns = problem_->columns[k];
    dense::fit(part_, std::ssize(columns), std::ssize(columns));
    part_ = V_(columns, columns);
    dense::set_product(problem_->A[k], part_, R_);
    dense::set_product_with_transpose(R_, problem_->A[k], M_[k]);
  }
}

void Approximation::change(int k, const Matrix& W) {
  const Eigen::Index m = W.rows();
  const Matrix D = W - W_[k];
  Matrix sum = Matrix::Identity(m, m);
  dense::add_product(D, M_[k], sum);
  const Eigen::PartialPivLU<Matrix> lu(sum);
  Matrix C = lu.solve(D);
  C = (0.5 * (C + C.transpose())).eval();
  trace_ += D.trace();
  log_determinant_ += std::log(std::max(lu.determinant(), 1e-300));
  dense::fit(part_, V_.rows(), std::ssize(problem_->columns[k]));
  part_ = V_(Eigen::all, problem_->columns[k]);
  dense::set_product_with_transpose(part_, problem_->A[k], VAt_);
  dense::set_product_with_transpose(C, VAt_, CVA_);
  dense::subtract_product(VAt_, CVA_, V_);
  for (const int j : followed_) {
    dense::fit(part_, std::ssize(problem_->columns[j]), VAt_.cols());
    part_ = VAt_(problem_->columns[j], Eigen::all);
    dense::set_product(problem_->A[j], part_, R_);
    dense::subtract_congruent(R_, C, M_[j]);
  }
  W_[k] = W;
}

double Approximation::kld() const { return 0.5 * (trace_ - log_determinant_ - problem_->rank); }

Approximation::Best Approximation::best(int k, double floor) const {
  switch (problem_->size(k)) {
    case 3:
      return best_of<3>(M_[k], W_[k], floor);
    case 6:
      return best_of<6>(M_[k], W_[k], floor);
    default:
      return best_of<Dynamic>(M_[k], W_[k], floor);
  }
}

double Approximation::bound(int k) const {
  switch (problem_->size(k)) {
    case 3:
      return 0.5 * excess<3>(M_[k]);
    case 6:
      return 0.5 * excess<6>(M_[k]);
    default:
      return 0.5 * excess<Dynamic>(M_[k]);
  }
}

double Approximation::gradient() const {
  double most = 0.0;
  for (int k = 0; k < problem_->factors(); ++k) {
    const Eigen::Index m = W_[k].rows();
    const Matrix moved = W_[k] - Matrix::Identity(m, m) + M_[k];
    most = std::max(most, (W_[k] - nearest_positive(moved)).cwiseAbs().maxCoeff());
  }
  return 0.5 * most;
}

}  // namespace cairn::sparsify
