// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/runtime/aligned.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Where the blocks of a whitened Jacobian J are: block rows are factors, block columns unknowns.
/// Structure and values are separate: a symbolic analysis of a structure is valid until `version`
/// changes.
class CAIRN_API JacobianStructure {
 public:
  JacobianStructure() = default;
  /// `row_sizes`, `column_sizes`: scalars of each block row (residual) and block column (unknown).
  /// Entries of block row i are row_begin[i] … row_begin[i+1]-1, in any order, `columns` their
  /// block columns; no column twice in a row. A row without entries is a factor all of whose
  /// variables are constant.
  JacobianStructure(std::vector<std::int32_t> row_sizes, std::vector<std::int32_t> column_sizes,
                    std::vector<std::int64_t> row_begin, std::vector<std::int32_t> columns);

  int block_rows() const { return static_cast<int>(row_sizes_.size()); }
  int block_columns() const { return static_cast<int>(column_sizes_.size()); }
  std::int64_t rows() const { return row_offsets_.empty() ? 0 : row_offsets_.back(); }
  std::int64_t size() const { return column_offsets_.empty() ? 0 : column_offsets_.back(); }
  std::span<const std::int32_t> row_sizes() const { return row_sizes_; }
  std::span<const std::int32_t> column_sizes() const { return column_sizes_; }
  /// First scalar row or column of each block; one more entry holds the total.
  std::span<const std::int64_t> row_offsets() const { return row_offsets_; }
  std::span<const std::int64_t> column_offsets() const { return column_offsets_; }

  std::span<const std::int64_t> row_begin() const { return row_begin_; }
  std::span<const std::int32_t> columns() const { return columns_; }
  std::int64_t entries() const { return static_cast<std::int64_t>(columns_.size()); }
  /// Where an entry's values start (column-major, residual × unknown); one more entry holds the
  /// total.
  std::span<const std::int64_t> value_begin() const { return value_begin_; }
  std::int64_t values() const { return value_begin_.empty() ? 0 : value_begin_.back(); }

  /// Differs between any two structures made in this process.
  std::uint64_t version() const { return version_; }

 private:
  std::vector<std::int32_t> row_sizes_;
  std::vector<std::int32_t> column_sizes_;
  std::vector<std::int64_t> row_offsets_;
  std::vector<std::int64_t> column_offsets_;
  std::vector<std::int64_t> row_begin_;
  std::vector<std::int32_t> columns_;
  std::vector<std::int64_t> value_begin_;
  std::uint64_t version_ = 0;
};

/// Values on a JacobianStructure, which must outlive it, and the residual r of the same rows.
class CAIRN_API JacobianMatrix {
 public:
  JacobianMatrix() = default;
  explicit JacobianMatrix(const JacobianStructure& structure);

  const JacobianStructure& structure() const { return *structure_; }
  std::span<double> values() { return values_; }
  std::span<const double> values() const { return values_; }
  double* block(std::int64_t entry) { return values_.data() + structure_->value_begin()[entry]; }
  const double* block(std::int64_t entry) const {
    return values_.data() + structure_->value_begin()[entry];
  }
  /// rows() doubles.
  std::span<double> residual() { return residual_; }
  std::span<const double> residual() const { return residual_; }

  /// y = J x; x has structure().size() doubles, y structure().rows().
  void multiply(std::span<const double> x, std::span<double> y) const;
  /// x = Jᵀ y.
  void multiply_transposed(std::span<const double> y, std::span<double> x) const;

 private:
  const JacobianStructure* structure_ = nullptr;
  AlignedVector values_;
  AlignedVector residual_;
};

/// Evaluates the whitened Jacobian of a graph at given states: one block row per factor, in the
/// order of the factors' positions, and one block column per variable that is not constant,
/// numbered as `Linearizer::block_of` does. Rows are scaled by √ρ′, so that JᵀJ is the H, and −Jᵀr
/// the g, of the linearizer.
///
/// Each factor is evaluated by a call of its own (`FactorType::evaluate`), in parallel; every
/// number has one writer, so results do not depend on the number of threads. Graph and linearizer
/// must outlive this object, and the graph keep its structure.
class CAIRN_API JacobianEvaluator {
 public:
  JacobianEvaluator(const Graph& graph, const Linearizer& linearizer);
  JacobianEvaluator(JacobianEvaluator&&) noexcept;
  ~JacobianEvaluator();

  const JacobianStructure& structure() const;
  /// Fills J (on `structure()`) and its residual.
  void evaluate(const Values& values, JacobianMatrix& J) const;

 private:
  struct Plan;
  std::unique_ptr<Plan> plan_;
};

/// Ability of a linear solver: works on J itself, whose condition number is the square root of that
/// of H = JᵀJ. Minimises ‖J x + r‖² + xᵀ D x with D diagonal (the damping), that is, solves
/// (H + D) x = −Jᵀ r. `NormalEquations` uses it instead of the solver's own analyze, factorize and
/// solve.
///
/// The contract is that of `LinearSolver`: `analyze` does what depends on the structure alone and
/// throws `Error` where that is beyond the solver; a J without full column rank is a failed
/// `Factorization` with the block column at which it shows; calls out of order throw
/// `std::logic_error`.
class CAIRN_API JacobianSolver {
 public:
  static constexpr std::string_view kAbility = "jacobian_solver";
  virtual ~JacobianSolver();

  virtual void analyze(const JacobianStructure& structure) = 0;
  /// `damping`: the diagonal of D, structure.size() doubles not below zero, or empty for D = 0.
  virtual Factorization factorize(const JacobianMatrix& J, std::span<const double> damping) = 0;
  /// x = argmin ‖J x + r‖² + xᵀ D x. residual: structure.rows() doubles; x: structure.size(). J
  /// must still hold the values that were factorised.
  virtual void minimize(std::span<const double> residual, std::span<double> x) = 0;
};

}  // namespace cairn
