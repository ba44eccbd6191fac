// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/graph/free_directions.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// H is singular to rounding where Σ_kk H_kk, which is 1 / (1 − R²) of unknown k given all others,
/// is larger than this: times the rounding of doubles, 2⁻⁵³, it is half of one per thousand, and
/// as a factorisation of a thousand unknowns adds up, two digits of Σ_kk may be all that is left.
/// Solvers that work on the Jacobian lose digits by the root of it, and have its square.
inline constexpr double kFewestDigits = 4.5e12;

/// Marginal covariances of a graph's variables at its present estimate x.
///
/// They are blocks of Σ = H⁻¹, H = Σ ρ′ JᵀJ at x, without any damping: the covariance of the vector
/// δ with x_true = retract(x, δ), in the units of the tangent space. For a pose, x · exp(δ), the
/// first numbers of δ are metres along the axes of the pose itself (not of the world) and the
/// others radians. They are covariances of the estimate if x is a minimum and the factors'
/// information is true. Fixed and anchored variables have zero blocks, and the
/// uncertainty of all others is relative to them.
///
/// Blocks are column-major, numbered by variables of the graph. Graph and solver must outlive this
/// object, and the graph keep its structure.
class CAIRN_API GraphMarginals {
 public:
  /// Throws `Error` (usage) if the solver lacks the ability `Marginals`.
  GraphMarginals(const Graph& graph, LinearSolver& solver);

  /// Linearises at the graph's states, factorises H and computes the block diagonal of Σ. It fails,
  /// too, where a direction is free (`FreeDirections`), whatever rounding makes of its pivot, and
  /// where H is singular to rounding (`kFewestDigits`). If it fails, `explain` says why, and
  /// nothing below may be called.
  Factorization factorize();
  std::string explain(const Factorization& failure) const;

  const NormalEquations& equations() const { return equations_; }
  const Gauge& gauge() const { return equations_.gauge(); }
  /// Scalar unknowns: rows of Σ.
  std::int64_t size() const { return equations_.size(); }
  /// Time of each part of `factorize`; without that of the block diagonal of Σ, which is the other.
  const Seconds& seconds() const { return equations_.seconds(); }
  double diagonal_seconds() const { return diagonal_seconds_; }

  /// Σ_vv of every variable, one after the other.
  std::vector<double> diagonal();
  /// Σ_ij of each pair (i, j), one after the other.
  std::vector<double> blocks(std::span<const std::pair<int, int>> pairs);
  /// Σ(:, variable): graph.tangent_size() rows, the variables in order.
  std::vector<double> column(int variable);

 private:
  const Graph* graph_;
  NormalEquations equations_;
  Marginals* marginals_;
  std::vector<double> diagonal_;  ///< blocks of Σ, of the variables that are not constant
  bool of_jacobian_;              ///< the solver works on J, not on H
  bool singular_ = false;         ///< to rounding
  FreeDirections free_;
  double diagonal_seconds_ = 0.0;
};

}  // namespace cairn
