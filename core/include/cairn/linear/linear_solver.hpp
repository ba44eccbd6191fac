// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// How a factorisation ended. Not being positive definite is an outcome, not an error.
struct Factorization {
  bool ok = true;
  int failed_block = -1;  ///< block at which the matrix stopped being positive definite
};

/// What a solver did; times are sums since the last `analyze`.
struct LinearSolverStats {
  std::string ordering;
  std::int64_t factor_nonzeros = 0;  ///< scalars in L, diagonal included; 0 if not known
  double factor_flops = 0.0;         ///< multiplications and additions of one factorisation
  std::string note;                  ///< what a user should know: "supernodal", "falls back to …"
  std::int64_t iterations = 0;     ///< inner iterations of an iterative solver; 0 for a direct one
  double relative_residual = 0.0;  ///< largest ‖Hx − g‖/‖g‖ so far; iterative solvers only

  CAIRN_API static ResultFields<LinearSolverStats> fields();
};

/// Solves H x = g for one block structure at a time, many times: `analyze` does all work that
/// depends on the structure alone (ordering, elimination tree, allocation); `factorize` and `solve`
/// only compute. H is symmetric positive definite, only its lower block triangle is stored.
///
/// `analyze` throws `Error` where the structure is beyond the solver (index overflow); `factorize`
/// and `solve` throw `std::logic_error` when called out of order.
class CAIRN_API LinearSolver : public Component {
 public:
  static constexpr std::string_view kKind = "linear_solver";
  ~LinearSolver() override;

  virtual void analyze(const BlockStructure& structure) = 0;
  virtual Factorization factorize(const BlockMatrix& H) = 0;
  /// x may be g. Sizes: structure.size().
  virtual void solve(std::span<const double> g, std::span<double> x) = 0;
  virtual const LinearSolverStats& stats() const = 0;
};

/// Ability: ln|H| of the last factorisation.
class CAIRN_API LogDeterminant {
 public:
  static constexpr std::string_view kAbility = "log_determinant";
  virtual ~LogDeterminant();
  virtual double log_determinant() const = 0;
};

/// Ability: several right-hand sides at a time, for less than one `solve` each.
class CAIRN_API ManyRightHandSides {
 public:
  static constexpr std::string_view kAbility = "many_right_hand_sides";
  virtual ~ManyRightHandSides();
  /// X = H⁻¹ G, both structure.size() × columns, column-major; X may be G.
  virtual void solve(std::span<const double> G, std::span<double> X, int columns) = 0;
};

/// Ability: the order in which the blocks of the analysed structure are eliminated. L has a block
/// at (row, column) of that order where H has, and where elimination fills in.
class CAIRN_API EliminationOrder {
 public:
  static constexpr std::string_view kAbility = "elimination_order";
  virtual ~EliminationOrder();
  /// Element k is the block eliminated k-th. Good until the next `analyze`.
  virtual std::span<const std::int32_t> elimination_order() const = 0;
};

}  // namespace cairn
