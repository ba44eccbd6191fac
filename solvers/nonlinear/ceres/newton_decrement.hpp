// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/SparseCholesky>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linearizer.hpp"
#include "ceres_problem.hpp"

namespace cairn {

/// The Gauss-Newton step H⁻¹g.
struct NewtonStep {
  double decrease = 0.0;  ///< of chi2, as predicted: gᵀ H⁻¹ g
  double norm = 0.0;      ///< ‖H⁻¹g‖ in the tangent spaces
};

/// What the quadratic model predicts that chi2 can still fall by: gᵀ H⁻¹ g, the (squared) Newton
/// decrement of Gauss-Newton (Boyd, Vandenberghe 2004, section 9.5.1). A method that uses gradients
/// alone cannot decide by itself whether it has converged: its steps are short where the problem is
/// badly conditioned as well. This factorises H once for each answer.
class NewtonDecrement {
 public:
  /// `graph` must outlive this object and keep its structure.
  NewtonDecrement(const Graph& graph, const Gauge& gauge);

  /// The step at these states; NaN where H is not positive definite, or the step does not solve
  /// H δ = g to a backward error of 10⁻⁶. A gauge that is free in part, and what else the
  /// measurements left free at the first states, gets a damping of 10⁻⁹ of H's diagonal, as
  /// Levenberg-Marquardt has it.
  NewtonStep at(const Values& values);

  /// Lᵀ and L⁻ᵀ of H's diagonal blocks at these states (block Jacobi), divided by `residual_scale`.
  TangentScaling block_jacobi(const Graph& graph, const Values& values, double residual_scale);

  /// Scalar unknowns.
  std::int64_t size() const { return linearizer_.structure().size(); }
  double seconds() const { return seconds_; }  ///< spent so far

 private:
  bool factorize(double damping);
  double backward_error(std::span<const double> step);

  Linearizer linearizer_;
  bool free_;  ///< H is singular
  BlockMatrix H_;
  std::vector<double> g_, product_;
  ScalarPattern pattern_;
  Eigen::SparseMatrix<double> lower_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky_;
  bool analysed_ = false;
  double seconds_ = 0.0;
};

}  // namespace cairn
