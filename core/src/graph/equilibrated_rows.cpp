// SPDX-License-Identifier: BSD-3-Clause
#include "equilibrated_rows.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A number below this part of the largest of its row is rounding.
constexpr double kNothing = 1e-14;
/// The squares of smaller numbers vanish.
constexpr double kVanishing = 1e-150;

void equilibrate(MatrixXd& J) {
  for (Eigen::Index row = 0; row < J.rows(); ++row) {
    const double largest = J.row(row).cwiseAbs().maxCoeff();
    if (largest > kVanishing) {
      J.row(row) =
          (J.row(row).array().abs() > kNothing * largest).select(J.row(row).array() / largest, 0.0);
    } else {
      J.row(row).setZero();
    }
  }
}

}  // namespace

VectorXd EquilibratedRows::largest_of_unit(std::int32_t variable, VectorXd numbers) const {
  const Eigen::Index n = numbers.size(), first = of_one_unit_[static_cast<std::size_t>(variable)];
  numbers.head(first).setConstant(numbers.head(first).maxCoeff());
  if (first < n) numbers.tail(n - first).setConstant(numbers.tail(n - first).maxCoeff());
  return numbers;
}

bool EquilibratedRows::evaluate(std::int32_t factor) {
  int columns = 0;
  evaluated_ = true;
  for (const std::int32_t v : variables(factor)) columns += size(v);
  const int of_all = factors_[static_cast<std::size_t>(factor)];
  J_.resize(rows_.rows(of_all), columns);
  rows_.jacobian(of_all, {J_.data(), static_cast<std::size_t>(J_.size())});
  finite_ = finite_ && J_.allFinite();
  if (finite_) equilibrate(J_);
  return finite_;
}

}  // namespace cairn
