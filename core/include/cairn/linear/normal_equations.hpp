// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/linear/seconds.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// The normal equations H δ = g of a graph with its gauge settled, and the linear solver that
/// solves them: what every second-order optimizer and estimator needs, with the time of each part
/// taken.
///
/// The constructor does all that depends on the structure alone (gauge, linearizer, the solver's
/// analysis); afterwards no call allocates more than the linear solver does. Graph and solver must
/// outlive this object, and the graph keep its structure. A failed factorisation is a status,
/// whose reason `explain` describes.
///
/// A solver with the ability `JacobianSolver` is given the whitened Jacobian instead of H, which is
/// then evaluated as well: H itself is available to the optimizer.
class CAIRN_API NormalEquations {
 public:
  NormalEquations(const Graph& graph, LinearSolver& solver);

  const Gauge& gauge() const { return gauge_; }
  const Linearizer& linearizer() const { return linearizer_; }
  /// Scalar unknowns; 0 if all variables are constant, and then nothing else may be called.
  std::int64_t size() const { return linearizer_.structure().size(); }

  /// Σ ρ(‖r‖²) at `values`.
  double chi2(const Values& values);
  /// H and g at `values`; returns chi2 there.
  double linearize(const Values& values);
  /// out = retract(values, step); out may be `values` itself.
  void retract(const Values& values, std::span<const double> step, Values& out);

  const BlockMatrix& H() const { return H_; }
  /// g = −Σ ρ′ Jᵀr, half the steepest descent of chi2; size() doubles.
  std::span<const double> g() const { return g_; }
  /// The scalar diagonal of H; size() doubles.
  std::span<const double> diagonal() const { return diagonal_; }

  Factorization factorize();
  /// Factorises H + diag(damping), damping being size() doubles; H itself stays as it is.
  Factorization factorize_damped(std::span<const double> damping);
  /// Factorises H + diag(pins) where H is singular and g has no part in its null space: with as
  /// many pins as that has dimensions, one in each, any solution solves H δ = g, and is checked as
  /// such by `backward_error`.
  Factorization factorize_pinned(std::span<const double> pins);
  /// step = (what was factorised)⁻¹ g.
  void solve(std::span<double> step);
  /// ‖A step − g‖ / (h ‖step‖ + ‖g‖) in the maximum norm, A being what was factorised last and h
  /// its largest diagonal entry: about 1e-16 for a backward stable solution, however
  /// ill-conditioned A is.
  double backward_error(std::span<const double> step);
  std::span<const double> solve_residual() const { return residual_; }  ///< its |A step − g|

  /// A sentence on why a factorisation of H failed: the variable at which it stopped, the likely
  /// number of gauge freedoms, why that variable is not determined, and what is free at the graph's
  /// states (`FreeDirections`). Takes about as long as a factorisation.
  std::string explain(const Factorization& failure) const;
  /// Directions in which chi2 hardly changes: eigenvalues below 1e-12 of H scaled to unit diagonal,
  /// counted by Sylvester's law of inertia on an LDLᵀ. -1 if they cannot be counted, as when H has
  /// values that are not finite.
  int free_directions() const;

  /// Time spent in each part so far; `total` is left at zero.
  const Seconds& seconds() const { return seconds_; }

 private:
  const Graph* graph_;
  LinearSolver* solver_;
  Seconds seconds_;
  Gauge gauge_;
  Linearizer linearizer_;
  BlockMatrix H_;
  std::vector<double> g_;
  std::vector<double> diagonal_;
  std::vector<double> damped_;  // diagonal with damping, if the last factorisation had any
  std::vector<double> residual_;

  JacobianSolver* jacobian_solver_ = nullptr;  // the solver, if it works on J
  std::optional<JacobianEvaluator> jacobian_;
  JacobianMatrix J_;
};

}  // namespace cairn
