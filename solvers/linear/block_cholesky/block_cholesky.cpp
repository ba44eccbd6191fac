// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>
#include <utility>

#include "block/ordering.hpp"
#include "block/supernodal_cholesky.hpp"
#include "cairn/linear_solver.hpp"
#include "cairn/registry.hpp"

namespace cairn {
namespace {

/// cairn's own linear solver: a thin coat over `block::SupernodalCholesky`.
class BlockCholesky final : public LinearSolver,
                            public LogDeterminant,
                            public EliminationOrder,
                            public ManyRightHandSides {
 public:
  BlockCholesky(std::string ordering, const std::string& kernels)
      : ordering_(std::move(ordering)), cholesky_(kernels) {}

  void analyze(const BlockStructure& structure) override {
    cholesky_.analyze(structure, ordering_);
    const block::Symbolic& symbolic = cholesky_.symbolic();
    stats_.ordering = cholesky_.ordering();
    stats_.factor_nonzeros = symbolic.factor_nonzeros;
    stats_.factor_flops = symbolic.factor_flops;
    stats_.note = std::to_string(symbolic.supernodes().size()) + " supernodes, " +
                  std::string(cholesky_.kernel_set()) + " kernels";
  }
  Factorization factorize(const BlockMatrix& H) override { return cholesky_.factorize(H); }
  void solve(std::span<const double> g, std::span<double> x) override { cholesky_.solve(g, x); }
  void solve(std::span<const double> G, std::span<double> X, int columns) override {
    cholesky_.solve(G, X, columns);
  }
  const LinearSolverStats& stats() const override { return stats_; }

  double log_determinant() const override { return cholesky_.log_determinant(); }
  std::span<const std::int32_t> elimination_order() const override {
    return cholesky_.symbolic().order();
  }
  void* ability(std::string_view name) override {
    if (name == LogDeterminant::kAbility) return static_cast<LogDeterminant*>(this);
    if (name == EliminationOrder::kAbility) return static_cast<EliminationOrder*>(this);
    if (name == ManyRightHandSides::kAbility) return static_cast<ManyRightHandSides*>(this);
    return nullptr;
  }

 private:
  std::string ordering_;
  block::SupernodalCholesky cholesky_;
  LinearSolverStats stats_;
};

}  // namespace
}  // namespace cairn

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver>(
      "block_cholesky",
      OptionTable{}
          .choice("ordering", "auto", block::every_ordering_name(),
                  "fill-reducing ordering of the block graph; auto: by predicted flops")
          .integer("last", 0, 0, 1e9,
                   "variables at the end that are eliminated last, as incremental solvers need; "
                   "not with metis")
          .choice("kernels", "auto", {"auto", "portable", "avx2", "avx512"},
                  "instruction set, as far as the machine has it"),
      [](const Options& options, Registry&) {
        std::string ordering = options.text("ordering");
        if (options.integer("last") > 0)
          ordering += ",last=" + std::to_string(options.integer("last"));
        return std::make_unique<BlockCholesky>(std::move(ordering), options.text("kernels"));
      });
}
