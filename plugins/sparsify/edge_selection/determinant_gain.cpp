// SPDX-License-Identifier: BSD-3-Clause
#include "determinant_gain.hpp"

#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "dense/cholesky.hpp"
#include "dense/products.hpp"

namespace cairn::edges {
namespace {

using Eigen::MatrixXd;

/// I + M = L Lᵀ.
Eigen::LLT<MatrixXd> factor_of(const MatrixXd& M) {
  return Eigen::LLT<MatrixXd>(MatrixXd(MatrixXd::Identity(M.rows(), M.rows()) + M));
}

}  // namespace

DeterminantGain::DeterminantGain(LinearModel model, LinearSolver& solver)
    : model_(std::move(model)), solver_(&solver), Q_(model_.structure->size(), kRank) {
  check_solver(*solver_);
  solver_->analyze(*model_.structure);
  factorize();
}

void DeterminantGain::factorize() {
  log_determinant(model_.H, *solver_);
  S_ = candidate_covariances(model_, *solver_);
  rank_ = 0;
}

MatrixXd DeterminantGain::J_times_Q(int k) const {
  const CandidateRows& rows = model_.candidates[static_cast<std::size_t>(k)];
  MatrixXd JQ = MatrixXd::Zero(rows.J[0].rows(), rank_);
  if (rank_ == 0) return JQ;  // for Eigen a product without columns begins at a null pointer
  for (std::size_t end = 0; end < 2; ++end) {
    if (rows.blocks[end] < 0) continue;
    const Eigen::Index first = model_.structure->offsets()[rows.blocks[end]];
    JQ += rows.J[end].lazyProduct(Q_.block(first, 0, rows.J[end].cols(), rank_));
  }
  return JQ;
}

MatrixXd DeterminantGain::covariance(int k) const {
  const MatrixXd& S = S_[static_cast<std::size_t>(k)];
  if (rank_ == 0) return S;
  const MatrixXd JQ = J_times_Q(k);
  return S - JQ.lazyProduct(JQ.transpose());
}

double DeterminantGain::gain(int k) const {
  const Eigen::LLT<MatrixXd> factor = factor_of(covariance(k));
  return 2.0 * factor.matrixLLT().diagonal().array().log().sum();
}

void DeterminantGain::solve(MatrixXd& X) {
  const std::span<double> all(X.data(), static_cast<std::size_t>(X.size()));
  if (auto* many = query<ManyRightHandSides>(*solver_)) {
    many->solve(all, all, static_cast<int>(X.cols()));
    return;
  }
  const auto rows = static_cast<std::size_t>(X.rows());
  for (std::size_t begin = 0; begin < all.size(); begin += rows)
    solver_->solve(all.subspan(begin, rows), all.subspan(begin, rows));
}

void DeterminantGain::add(int k) {
  const CandidateRows& rows = model_.candidates[static_cast<std::size_t>(k)];
  const Eigen::Index m = S_[static_cast<std::size_t>(k)].rows();
  model_.add(k, 1.0, model_.H);
  if (rank_ + m > kRank) return factorize();
  // X = Σ₀ Jᵀ − Q (J Q)ᵀ, and Q gets X L⁻ᵀ.
  MatrixXd X = MatrixXd::Zero(Q_.rows(), m);
  for (std::size_t end = 0; end < 2; ++end) {
    if (rows.blocks[end] < 0) continue;
    X.middleRows(model_.structure->offsets()[rows.blocks[end]], rows.J[end].cols()) +=
        rows.J[end].transpose();
  }
  const MatrixXd QJ = J_times_Q(k).transpose();
  solve(X);
  if (rank_ > 0) dense::subtract_product(Q_.leftCols(rank_), QJ, X);
  const Eigen::LLT<MatrixXd> factor = factor_of(covariance(k));
  for (Eigen::Index c = 0; c < m; ++c) {  // X L⁻ᵀ by columns, L being small
    Eigen::VectorXd q = X.col(c);
    for (Eigen::Index j = 0; j < c; ++j) q -= factor.matrixLLT()(c, j) * Q_.col(rank_ + j);
    Q_.col(rank_ + c) = q / factor.matrixLLT()(c, c);
  }
  rank_ += m;
}

}  // namespace cairn::edges
