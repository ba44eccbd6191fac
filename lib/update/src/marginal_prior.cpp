// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/marginal_prior.hpp"

#include <cmath>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Eigenvalues of the scaled H below this are what rounding left of a zero.
constexpr double kZeroEigenvalue = 1e-12;

/// M becomes U M, U being upper triangular and packed row by row. Nothing is done for the identity.
template <class Matrix>
void whiten(const double* packed, Matrix& M) {
  const Eigen::Index n = M.rows();
  bool identity = true;
  const double* u = packed;
  for (Eigen::Index row = 0; identity && row < n; ++row) {
    for (Eigen::Index k = row; k < n; ++k) identity = identity && *u++ == (k == row ? 1.0 : 0.0);
  }
  if (identity) return;
  for (Eigen::Index row = 0; row < n; ++row) {
    M.row(row) *= packed[0];
    for (Eigen::Index k = row + 1; k < n; ++k) M.row(row) += packed[k - row] * M.row(k);
    packed += n - row;
  }
}

}  // namespace

LinearResidual square_root(std::span<const double> H, std::span<const double> g,
                           std::span<const double> scale) {
  const auto n = static_cast<Eigen::Index>(g.size());
  const VectorXd unit = Eigen::Map<const VectorXd>(scale.data(), n).cwiseSqrt();
  const VectorXd to_unit = unit.cwiseInverse();
  const MatrixXd scaled =
      to_unit.asDiagonal() * Eigen::Map<const MatrixXd>(H.data(), n, n) * to_unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);  // λ rising
  const Eigen::Index dropped = (eigen.eigenvalues().array() <= kZeroEigenvalue).count();
  const Eigen::Index rank = n - dropped;

  LinearResidual result{static_cast<int>(rank), static_cast<int>(n), {}, {}};
  result.A.resize(static_cast<std::size_t>(rank * n));
  result.b.resize(static_cast<std::size_t>(rank));
  const VectorXd root = eigen.eigenvalues().tail(rank).cwiseSqrt();
  const auto V = eigen.eigenvectors().rightCols(rank);
  Eigen::Map<MatrixXd>(result.A.data(), rank, n) =
      root.asDiagonal() * V.transpose() * unit.asDiagonal();
  Eigen::Map<VectorXd>(result.b.data(), rank) =
      root.cwiseInverse().asDiagonal() *
      (V.transpose() * (to_unit.asDiagonal() * Eigen::Map<const VectorXd>(g.data(), n)));
  return result;
}

struct MarginalPrior::Evaluation {
  VectorXd r;
  MatrixXd J;
};

MarginalPrior::MarginalPrior(std::vector<Variable> variables, LinearResidual residual,
                             int absolute_size)
    : variables_(std::move(variables)),
      offsets_{0},
      residual_(std::move(residual)),
      absolute_size_(absolute_size) {
  for (const Variable& variable : variables_) {
    tags_.push_back(variable.type->tag());
    offsets_.push_back(offsets_.back() + variable.type->tangent_size());
    if (variable.origin.size() != static_cast<std::size_t>(variable.type->ambient_size())) {
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: the origin of a {} has {} numbers, expected {}", kTag,
                      variable.type->tag(), variable.origin.size(), variable.type->ambient_size()));
    }
  }
  const auto rows = static_cast<std::size_t>(residual_.rows),
             columns = static_cast<std::size_t>(residual_.columns);
  if (residual_.rows < 1 || residual_.columns != offsets_.back() ||
      residual_.A.size() != rows * columns || residual_.b.size() != rows) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: A is {} × {} with {} + {} numbers, expected at least one row, {} "
                            "columns, and A and b to fit",
                            kTag, residual_.rows, residual_.columns, residual_.A.size(),
                            residual_.b.size(), offsets_.back()));
  }
}

std::vector<double> MarginalPrior::unit_information() const {
  return pack(Eigen::MatrixXd::Identity(residual_.rows, residual_.rows));
}

/// dr/dε of variable k is A_k D_k⁻¹: a step ε from x_k changes local(origin_k, x_k) by D_k⁻¹ε (see
/// `VariableType::retract_jacobian`).
MarginalPrior::Evaluation MarginalPrior::evaluate_at(const double* const* x,
                                                     const double* sqrt_information,
                                                     bool with_jacobian) const {
  const Eigen::Map<const MatrixXd> A(residual_.A.data(), residual_.rows, residual_.columns);
  Evaluation result{-Eigen::Map<const VectorXd>(residual_.b.data(), residual_.rows), {}};
  VectorXd e(residual_.columns);
  if (with_jacobian) result.J.resize(residual_.rows, residual_.columns);
  for (int k = 0; k < arity(); ++k) {
    const VariableType& type = *variables_[k].type;
    const int begin = offsets_[k], size = offsets_[k + 1] - begin;
    type.local(1, variables_[k].origin.data(), x[k], e.data() + begin);
    if (!with_jacobian) continue;
    MatrixXd D(size, size);
    type.retract_jacobian(variables_[k].origin.data(), e.data() + begin, D.data());
    result.J.middleCols(begin, size) = dense::product(A.middleCols(begin, size), D.inverse());
  }
  result.r += A * e;
  whiten(sqrt_information, result.r);
  if (with_jacobian) whiten(sqrt_information, result.J);
  return result;
}

void MarginalPrior::evaluate(const double* const* x, const double* /*measurement*/,
                             const double* sqrt_information, double* residual,
                             double* const* jacobians) const {
  const Evaluation at = evaluate_at(x, sqrt_information, jacobians != nullptr);
  Eigen::Map<VectorXd>(residual, residual_.rows) = at.r;
  for (int k = 0; jacobians && k < arity(); ++k) {
    if (!jacobians[k]) continue;
    const int begin = offsets_[k], size = offsets_[k + 1] - begin;
    Eigen::Map<MatrixXd>(jacobians[k], residual_.rows, size) = at.J.middleCols(begin, size);
  }
}

}  // namespace cairn
