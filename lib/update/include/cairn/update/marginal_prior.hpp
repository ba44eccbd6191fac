// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/types/evaluated_factor.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/never_throws.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// A linear residual r = A e − b; A is rows × columns, column-major.
struct LinearResidual {
  int rows = 0;
  int columns = 0;
  std::vector<double> A;
  std::vector<double> b;
};

/// The square root of a quadratic form eᵀHe/2 − gᵀe: A and b with AᵀA = H and Aᵀb = g, and as many
/// rows as H has rank.
///
/// `H` is n × n, column-major, symmetric and positive semidefinite but for rounding; n is the size
/// of `g`. `scale` holds n positive numbers that say how large an entry of H's diagonal is large:
/// directions whose eigenvalue is below 1e-12 of H scaled by them (H_ij / √(scale_i scale_j)) are
/// taken for rounding and dropped. Where H came of a Schur complement, these are the diagonal
/// before the subtraction, since that is what rounding is relative to.
CAIRN_API LinearResidual square_root(std::span<const double> H, std::span<const double> g,
                                     std::span<const double> scale);

/// The information of marginalised factors about the variables that stay, as a linear prior: the
/// residual r = A e − b, where e stacks local(origin_k, x_k) of its variables, the tangent vectors
/// from where they were when the measurements were linearised. A and b stay as they are, whatever
/// the variables do later (Kaess et al. 2012 and others call it a linear container factor; how it
/// is made: `eliminate`).
///
/// Each object serves one factor of a graph, with any number of variables of any types; its
/// measurement is empty, its information the identity. It cannot be written to files.
class CAIRN_API MarginalPrior final : public EvaluatedFactorType, public NeverThrows {
 public:
  static constexpr std::string_view kTag = "MARGINAL_PRIOR";

  struct Variable {
    std::shared_ptr<const VariableType> type;
    std::vector<double> origin;  ///< ambient_size doubles
  };

  /// `residual` has one column for each tangent direction of the variables, in their order.
  /// `absolute_size`: see `FactorType`. Throws `Error` (usage) if the sizes do not fit or there is
  /// no row.
  MarginalPrior(std::vector<Variable> variables, LinearResidual residual, int absolute_size);

  const LinearResidual& linear_residual() const { return residual_; }
  const std::vector<Variable>& variables() const { return variables_; }
  /// The information matrix of the factor in a graph: the identity, packed.
  std::vector<double> unit_information() const;

  std::string_view tag() const override { return kTag; }
  int arity() const override { return static_cast<int>(variables_.size()); }
  std::span<const std::string_view> variable_tags() const override { return tags_; }
  int residual_size() const override { return residual_.rows; }
  int measurement_size() const override { return 0; }
  int tangent_size(int variable) const override {
    return variables_[variable].type->tangent_size();
  }
  int ambient_size(int variable) const override {
    return variables_[variable].type->ambient_size();
  }
  std::string normalize(double*) const override { return {}; }
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override;
  bool propagate(int, const double* const*, const double*, double*) const override { return false; }
  bool is_relative() const override { return false; }
  int absolute_size() const override { return absolute_size_; }
  bool takes_loss() const override { return false; }

 private:
  struct Evaluation;
  Evaluation evaluate_at(const double* const* x, const double* sqrt_information,
                         bool with_jacobian) const;

  std::vector<Variable> variables_;
  std::vector<std::string_view> tags_;
  std::vector<int> offsets_;  // of each variable's columns; one more holds their number
  LinearResidual residual_;
  int absolute_size_;
};

}  // namespace cairn
