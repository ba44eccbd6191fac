// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <cholmod.h>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/option_fields.hpp"

namespace cairn {

/// How CHOLMOD factorises.
enum class CholmodMode {
  automatic,   ///< supernodal where the fill is dense enough to pay (40 flops per nonzero of L)
  simplicial,  ///< column by column, without BLAS
  supernodal,  ///< dense blocks through BLAS
};

constexpr auto enum_names(CholmodMode) {
  return std::to_array<EnumName<CholmodMode>>({{CholmodMode::automatic, "auto"},
                                               {CholmodMode::simplicial, "simplicial"},
                                               {CholmodMode::supernodal, "supernodal"}});
}

struct CholmodOptions {
  CholmodMode mode = CholmodMode::automatic;
  std::string ordering = "amd";  ///< fill-reducing, see `order_scalars`

  static auto fields() {
    using O = CholmodOptions;
    return OptionFields<O>()
        .choice("mode", &O::mode,
                "simplicial is column by column, supernodal by dense blocks through BLAS; auto "
                "chooses by fill")
        .choice("ordering", &O::ordering, {"amd", "csymamd", "metis", "nesdis", "natural"},
                "fill-reducing ordering, computed on the graph of the blocks");
  }
};

/// Adapter of CHOLMOD (Chen, Davis, Hager, Rajamanickam 2008): H = P L Lᵀ Pᵀ, with P from the graph
/// of the blocks. Block values are scattered into scalar form by a map computed once per structure.
/// Every instance has a workspace of its own; CHOLMOD neither prints nor aborts.
class CholmodSolver final : public LinearSolver, public LogDeterminant, public ManyRightHandSides {
 public:
  explicit CholmodSolver(const CholmodOptions& options);
  ~CholmodSolver() override;

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H) override;
  void solve(std::span<const double> g, std::span<double> x) override;
  void solve(std::span<const double> G, std::span<double> X, int columns) override;
  const LinearSolverStats& stats() const override { return stats_; }

  double log_determinant() const override;
  void* ability(std::string_view name) override;

 private:
  void free_factor();
  cholmod_sparse matrix();
  void read_pivots();
  Factorization failed_at(std::size_t column) const;

  const std::string ordering_;
  cholmod_common common_;
  cholmod_factor* L_ = nullptr;
  // Results and workspace of solve, allocated by CHOLMOD at the first one and reused.
  cholmod_dense* x_ = nullptr;
  cholmod_dense* y_ = nullptr;
  cholmod_dense* e_ = nullptr;

  std::uint64_t version_ = 0;  // of the structure that was analysed
  ScalarPattern pattern_;
  std::vector<double> values_;  // of the pattern
  std::vector<int> block_of_scalar_;
  std::vector<double> pivots_;  // the diagonal of L
  LinearSolverStats stats_;
  SolvedMarginals marginals_{*this};
  bool factorized_ = false;
};

}  // namespace cairn
