// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/elements.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn::compact {

/// A factor, checked, with the root of its information.
class Measured {
 public:
  /// At a state of each variable: whitened residual, and its Jacobian by a step of each.
  struct Linear {
    Eigen::VectorXd residual;
    std::vector<Eigen::MatrixXd> J;
  };

  /// `types`: of its variables. Throws `Error` (input), beginning with `name`, for a factor that is
  /// not on variables of these types, or that is not valid.
  Measured(const Factor& factor, std::span<const VariableType* const> types,
           const std::string& name);

  /// With a measurement in canonical form.
  const Factor& factor() const { return factor_; }
  Linear at(std::span<const double* const> states) const;
  /// ‖e‖² of the whitened residual alone.
  double squared_norm(std::span<const double* const> states) const;

 private:
  Factor factor_;
  std::vector<int> tangents_;
  std::vector<double> root_;  ///< of its information
};

/// How a measurement compares with the estimate: its residual e ~ N(0, V), whitened, V = I + J Σ
/// Jᵀ.
struct MeasuredFit {
  double gain = 0.0;        ///< ½ ln |V|: the entropy that the state loses by it [nats]
  double innovation = 0.0;  ///< eᵀ V⁻¹ e
  int dof = 0;              ///< directions in which it measures anything
};
/// Of the residual e with the covariance S = J Σ Jᵀ of what is expected, and the Jacobian J.
MeasuredFit compare(const Eigen::VectorXd& e, const Eigen::MatrixXd& S, const Eigen::MatrixXd& J);

/// How many eigenvalues of J Jᵀ are more than rounding.
int rank(const Eigen::MatrixXd& J);

}  // namespace cairn::compact
