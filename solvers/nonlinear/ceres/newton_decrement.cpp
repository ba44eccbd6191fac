// SPDX-License-Identifier: BSD-3-Clause
#include "newton_decrement.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "cairn/graph/free_directions.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn {
namespace {

constexpr double kFreeDamping = 1e-9;  ///< of the diagonal of H
constexpr double kNothing = 1e-14;     ///< of its largest entry: what is smaller is rounding
constexpr double kLargestBackwardError = 1e-6;  ///< of a step that solves its system
constexpr double kSmallestOfABlock = 1e-9;      ///< of its largest diagonal entry

double largest(std::span<const double> numbers) {
  double result = 0.0;
  for (const double number : numbers) result = std::max(result, std::abs(number));
  return result;
}

/// Directions of a variable that nothing measures get the largest eigenvalue: else rounding of the
/// gradient, in their coordinates, would be a slope.
Eigen::MatrixXd without_free_directions(const Eigen::MatrixXd& B) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(B);
  const double most = eigen.eigenvalues().maxCoeff();
  if (eigen.eigenvalues().minCoeff() > kNothing * most) return B;
  const Eigen::VectorXd values = eigen.eigenvalues().unaryExpr(
      [&](double value) { return value > kNothing * most ? value : most; });
  return eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

NewtonDecrement::NewtonDecrement(const Graph& graph, const Gauge& gauge)
    : linearizer_(graph, gauge.held),
      free_(!gauge.left_free.empty() ||
            !find_free_directions(graph, gauge, graph.values()).empty()),
      H_(linearizer_.structure()),
      g_(static_cast<std::size_t>(linearizer_.structure().size())),
      product_(g_.size()),
      pattern_(linearizer_.structure(), ScalarPattern::Triangle::lower) {
  const auto n = static_cast<Eigen::Index>(g_.size());
  lower_.resize(n, n);
  lower_.resizeNonZeros(pattern_.nonzeros());
  std::ranges::copy(pattern_.column_begin(), lower_.outerIndexPtr());
  std::ranges::copy(pattern_.rows(), lower_.innerIndexPtr());
}

NewtonStep NewtonDecrement::at(const Values& values) {
  const auto begin = std::chrono::steady_clock::now();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  NewtonStep result{nan, nan};
  linearizer_.linearize(values, H_, g_);
  if (std::isfinite(largest(g_)) && factorize(free_ ? kFreeDamping : 0.0)) {
    const Eigen::Map<const Eigen::VectorXd> g(g_.data(), std::ssize(g_));
    const Eigen::VectorXd step = cholesky_.solve(g);
    if (backward_error({step.data(), g_.size()}) <= kLargestBackwardError)
      result = {g.dot(step), step.norm()};
  }
  seconds_ += seconds_since(begin);
  return result;
}

bool NewtonDecrement::factorize(double damping) {
  if (damping > 0.0) {
    std::vector<double> diagonal(g_.size());
    H_.diagonal(diagonal);
    const double most = largest(diagonal);
    for (double& entry : diagonal) entry += damping * (entry > kNothing * most ? entry : most);
    H_.set_diagonal(diagonal);
  }
  pattern_.scatter(H_, {lower_.valuePtr(), static_cast<std::size_t>(pattern_.nonzeros())});
  if (!std::exchange(analysed_, true)) cholesky_.analyzePattern(lower_);
  cholesky_.factorize(lower_);
  return cholesky_.info() == Eigen::Success;
}

double NewtonDecrement::backward_error(std::span<const double> step) {
  std::vector<double> diagonal(g_.size());
  H_.diagonal(diagonal);
  H_.multiply(step, product_);
  for (std::size_t k = 0; k < g_.size(); ++k) product_[k] -= g_[k];
  const double size = largest(diagonal) * largest(step) + largest(g_);
  return size > 0.0 ? largest(product_) / size : 0.0;
}

TangentScaling NewtonDecrement::block_jacobi(const Graph& graph, const Values& values,
                                             double residual_scale) {
  linearizer_.linearize(values, H_, g_);
  const BlockStructure& structure = linearizer_.structure();
  TangentScaling scaling;
  scaling.Lt.resize(static_cast<std::size_t>(graph.variable_count()));
  scaling.Lt_inverse.resize(scaling.Lt.size());
  for (int block = 0; block < structure.blocks(); ++block) {
    const int n = structure.block_size(block);
    const auto diagonal = structure.column_begin()[block];  // the first block of its column
    Eigen::MatrixXd B = Eigen::Map<const Eigen::MatrixXd>(H_.block(diagonal), n, n);
    const double top = B.diagonal().maxCoeff();
    if (!(top > 0.0) || !std::isfinite(top)) B.setIdentity();
    B = without_free_directions(B);
    B.diagonal().array() += kSmallestOfABlock * B.diagonal().maxCoeff();
    Eigen::MatrixXd Lt = B.llt().matrixU();
    if (!(Lt.diagonal().minCoeff() > 0.0)) Lt.setIdentity();
    const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(n, n);
    Eigen::MatrixXd inverse = Lt.triangularView<Eigen::Upper>().solve(I) / residual_scale;
    Lt *= residual_scale;
    if (!Lt.allFinite() || !inverse.allFinite())
      Lt = inverse = I;  // Ceres accepts finite ones only
    const auto variable = static_cast<std::size_t>(linearizer_.variable_of(block));
    scaling.Lt[variable].assign(Lt.data(), Lt.data() + Lt.size());
    scaling.Lt_inverse[variable].assign(inverse.data(), inverse.data() + inverse.size());
  }
  return scaling;
}

}  // namespace cairn
