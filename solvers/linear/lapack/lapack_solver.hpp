// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/aligned.hpp"

namespace cairn {

struct LapackOptions {
  std::int64_t max_size = 8000;  ///< unknown scalars

  static auto fields() {
    return OptionFields<LapackOptions>().integer(
        "max_size", &LapackOptions::max_size, 1, 46000,
        "maximum number of scalar unknowns: a dense matrix of 8000 takes 0.5 GB");
  }
};

/// Dense Cholesky H = L Lᵀ by LAPACK's dpotrf and dpotrs on the lower triangle, in the order given:
/// n²·8 bytes and n³/3 operations for n scalars, whatever the structure. It uses nothing of
/// cairn's sparse machinery, which makes it the oracle for the other solvers on small systems.
class LapackSolver final : public LinearSolver, public LogDeterminant {
 public:
  /// Beyond `options.max_size` scalars `analyze` throws `Error` (usage).
  explicit LapackSolver(const LapackOptions& options);

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H) override;
  void solve(std::span<const double> g, std::span<double> x) override;
  const LinearSolverStats& stats() const override { return stats_; }

  double log_determinant() const override;
  void* ability(std::string_view name) override;

 private:
  void scatter(const BlockMatrix& H);
  Factorization failed_at(std::int64_t scalar) const;

  const std::int64_t max_size_;
  std::uint64_t version_ = 0;  // of the structure that was analysed
  int size_ = 0;
  std::vector<std::int32_t> block_of_scalar_;
  AlignedVector dense_;  // column-major; the lower triangle is H, then L
  LinearSolverStats stats_;
  SolvedMarginals marginals_{*this};
  bool factorized_ = false;
};

}  // namespace cairn
