// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "cairn/graph/free_directions.hpp"

namespace cairn {

/// The factors of a search for free directions, numbered by their places in `FreeSearch::factors`.
/// Each row of a Jacobian is divided by its largest number: what a row leaves free does not depend
/// on how much it weighs, and where rows differ by many orders of magnitude the weak ones are
/// measurements still.
class EquilibratedRows {
 public:
  EquilibratedRows(const LinearRows& rows, const FreeSearch& search)
      : rows_(rows),
        sizes_(search.sizes),
        of_one_unit_(search.of_one_unit),
        factors_(search.factors) {}

  std::int32_t factors() const { return static_cast<std::int32_t>(factors_.size()); }
  std::int32_t variables() const { return static_cast<std::int32_t>(sizes_.size()); }
  std::span<const std::int32_t> variables(std::int32_t factor) const {
    return rows_.variables(factors_[static_cast<std::size_t>(factor)]);
  }
  bool determines_each(std::int32_t factor) const {
    return rows_.determines_each(factors_[static_cast<std::size_t>(factor)]);
  }
  int size(std::int32_t variable) const { return sizes_[static_cast<std::size_t>(variable)]; }
  /// Each number of a variable's tangent space replaced by the largest of the same unit.
  Eigen::VectorXd largest_of_unit(std::int32_t variable, Eigen::VectorXd numbers) const;

  /// Computes `J` of a factor. False, from then on, if it has numbers that are not finite.
  bool evaluate(std::int32_t factor);
  const Eigen::MatrixXd& J() const { return J_; }
  bool finite() const { return finite_; }
  /// Whether what has been asked so far is the same at all states.
  bool constant() const { return !evaluated_ && rows_.constant(); }

 private:
  const LinearRows& rows_;
  std::span<const std::int32_t> sizes_, of_one_unit_, factors_;
  Eigen::MatrixXd J_;
  bool finite_ = true;
  bool evaluated_ = false;
};

}  // namespace cairn
