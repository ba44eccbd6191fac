// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/aligned.hpp"
#include "schur_plan.hpp"

namespace cairn {

struct SchurOptions {
  std::string linear_solver = "block_cholesky";  ///< of the reduced system
  std::string eliminate = "auto";                ///< see `schur::elimination_set`
  /// Of a reduced system that is nearly dense and large: pcg instead, or as any other.
  std::string dense = "direct";
  std::string kernels = "auto";  ///< auto, portable, avx2 or avx512

  static auto fields() {
    using O = SchurOptions;
    return OptionFields<O>()
        .component<LinearSolver>("linear_solver", &O::linear_solver, "solves the reduced system")
        .choice("eliminate", &O::eliminate, {"auto", "smallest", "independent_set"},
                "blocks that are eliminated first; auto: the smallest where they are most of all "
                "and not adjacent, else an independent set")
        .choice("dense", &O::dense, {"direct", "pcg"},
                "a reduced system that is nearly dense, and large, as that of hundreds of cameras "
                "which all share points: by linear_solver, or by pcg, which takes less time to the "
                "accuracy that a step needs")
        .choice("kernels", &O::kernels, {"auto", "portable", "avx2", "avx512"},
                "instruction set, as far as the machine has it");
  }
};

/// Solves H x = g by eliminating an independent set E of blocks first, such as the points of a
/// bundle adjustment, and solving for the others, R, by any linear solver (Brown 1958; Triggs et
/// al. 2000, §6.1):
///
///     S = H_RR − H_RE H_EE⁻¹ H_ER,   S x_R = g_R − H_RE H_EE⁻¹ g_E,   x_E = H_EE⁻¹(g_E − H_ER x_R)
///
/// H_EE is block diagonal, so each of its blocks is factorised by itself. All index work is done
/// once per structure (`schur::SchurPlan`); after that nothing is allocated here. Each block of S
/// has one writer, which adds up in the order of E: results do not depend on the number of threads.
///
/// Failures, statistics, the logarithm of the determinant and the order of elimination are those of
/// the whole; the last two, many right-hand sides and marginals (by solves) where the inner solver
/// has the ability.
class SchurSolver final : public LinearSolver,
                          public LogDeterminant,
                          public EliminationOrder,
                          public ManyRightHandSides {
 public:
  /// `inner` solves the reduced system; `of_dense` one that is nearly dense and large, null:
  /// `inner` as well. With it there are steps alone: none of the abilities, since what it gives is
  /// inexact. Throws `Error` (usage) for kernels that the machine cannot run.
  SchurSolver(std::unique_ptr<LinearSolver> inner, std::unique_ptr<LinearSolver> of_dense,
              const SchurOptions& options);

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H) override;
  void solve(std::span<const double> g, std::span<double> x) override;
  void solve(std::span<const double> G, std::span<double> X, int columns) override;
  const LinearSolverStats& stats() const override { return stats_; }

  double log_determinant() const override;
  std::span<const std::int32_t> elimination_order() const override;
  void* ability(std::string_view name) override;

 private:
  /// One right-hand side during a solve: z and y are memory for E and R, y with schur::kOverread
  /// more.
  struct Side {
    const double* g;
    double* x;
    double* z;  // L⁻¹ g_E, then x_E
    double* y;  // g_R less what E contributes, then x_R
  };
  bool eliminate(const BlockMatrix& H);
  void reduce(const BlockMatrix& H);
  void reduce(const Side& side);
  void reduce_row(const Side& side, std::size_t block);
  void substitute_back(const Side& side);
  void substitute_into(const Side& side, const schur::Eliminated& element);
  void update_stats();

  std::unique_ptr<LinearSolver> inner_, of_dense_;
  LinearSolver* chosen_;  // of the two
  LogDeterminant* inner_determinant_ = nullptr;
  EliminationOrder* inner_order_ = nullptr;
  ManyRightHandSides* inner_many_ = nullptr;
  std::string eliminate_;
  const schur::Kernels* kernels_;

  std::uint64_t version_ = 0;
  bool factorized_ = false;
  schur::SchurPlan plan_;
  BlockMatrix S_;
  AlignedVector L_;                    // of each eliminated block, with reciprocal diagonals
  AlignedVector Y_;                    // H_RE L⁻ᵀ, by remaining blocks
  std::vector<std::int32_t> failed_;   // by elimination task: the first block that failed, or -1
  std::vector<double> z_, y_;          // of one Side, or of many
  std::vector<std::int64_t> vectors_;  // first scalar row in H, by remaining block
  mutable std::vector<std::int32_t> order_;
  LinearSolverStats stats_;
  SolvedMarginals marginals_{*this};
};

}  // namespace cairn
