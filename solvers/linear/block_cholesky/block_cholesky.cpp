// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "block/chain_cholesky.hpp"
#include "block_cholesky_options.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn {
namespace {

/// Covariances by selected inversion: diagonal blocks, and all others where L has blocks, are
/// computed once a factorisation, when they are first asked for. What is beyond L's pattern, and
/// requests so small that a few solves are less than the whole recursion, are solved for.
class BlockMarginals final : public SolvedMarginals {
 public:
  BlockMarginals(LinearSolver& solver, block::ChainCholesky& cholesky)
      : SolvedMarginals(solver), cholesky_(cholesky), inverse_(cholesky) {}

  /// What was computed belongs to a factorisation that is no more.
  void forget() { computed_ = false; }

  void diagonal_blocks(std::span<double> out) override {
    compute();
    inverse_.diagonal_blocks(out);
  }
  void blocks(std::span<const std::pair<std::int32_t, std::int32_t>> pairs,
              std::span<double> out) override;

 private:
  /// Operations on a scalar of L in a solve with eight right-hand sides, about, in terms of those
  /// of a factorisation, which keeps its operands in registers.
  static constexpr double kSolveFlops = 50.0;

  void columns(std::span<const std::int64_t> scalars, std::span<double> X) override {
    cholesky_.inverse_columns(scalars, X);
  }
  void compute() {
    if (!computed_) inverse_.compute();
    computed_ = true;
  }

  block::ChainCholesky& cholesky_;
  block::ChainInverse inverse_;
  bool computed_ = false;
};

void BlockMarginals::blocks(std::span<const std::pair<std::int32_t, std::int32_t>> pairs,
                            std::span<double> out) {
  const std::int64_t together = (columns_of(pairs) + 7) / 8;
  const auto solves = static_cast<double>(together);
  const double nonzeros = static_cast<double>(cholesky_.factor_nonzeros());
  if (!computed_ && solves * kSolveFlops * nonzeros < cholesky_.factor_flops())
    return SolvedMarginals::blocks(pairs, out);
  compute();
  std::vector<std::pair<std::int32_t, std::int32_t>> missing;
  std::vector<std::int64_t> places;
  std::int64_t place = 0, values_missing = 0;
  for (const auto& [i, j] : pairs) {
    if (place + values(i, j) > std::ssize(out))
      throw std::logic_error("blocks: there is too little room for them");
    if (!inverse_.block(i, j, out.data() + place)) {
      missing.emplace_back(i, j);
      places.push_back(place);
      values_missing += values(i, j);
    }
    place += values(i, j);
  }
  std::vector<double> solved(values_missing);
  SolvedMarginals::blocks(missing, solved);
  auto from = solved.begin();
  for (std::size_t k = 0; k < missing.size(); ++k) {
    const std::int64_t count = values(missing[k].first, missing[k].second);
    std::copy_n(from, count, out.begin() + places[k]);
    from += count;
  }
}

/// cairn's own linear solver: a thin coat over `block::ChainCholesky`.
class BlockCholesky final : public LinearSolver,
                            public LogDeterminant,
                            public EliminationOrder,
                            public ManyRightHandSides {
 public:
  explicit BlockCholesky(const BlockCholeskyOptions& options)
      : ordering_(options.ordering_text()),
        is_mixed_(options.precision == "mixed"),
        cholesky_(options.kernels,
                  is_mixed_ ? block::Precision::mixed : block::Precision::in_double) {}

  void analyze(const BlockStructure& structure) override {
    cholesky_.analyze(structure, ordering_);
    marginals_.analyze(structure.sizes());
    marginals_.forget();
    stats_.ordering = cholesky_.ordering();
    stats_.factor_nonzeros = cholesky_.factor_nonzeros();
    stats_.factor_flops = cholesky_.factor_flops();
    stats_.note = cholesky_.description();
  }
  Factorization factorize(const BlockMatrix& H) override {
    marginals_.forget();
    return cholesky_.factorize(H);
  }
  void solve(std::span<const double> g, std::span<double> x) override {
    cholesky_.solve(g, x);
    if (is_mixed_) stats_.note = cholesky_.description();
  }
  void solve(std::span<const double> G, std::span<double> X, int columns) override {
    cholesky_.solve(G, X, columns);
  }
  const LinearSolverStats& stats() const override { return stats_; }

  double log_determinant() const override { return cholesky_.log_determinant(); }
  std::span<const std::int32_t> elimination_order() const override { return cholesky_.order(); }
  void* ability(std::string_view name) override {
    if (name == LogDeterminant::kAbility) return static_cast<LogDeterminant*>(this);
    if (name == EliminationOrder::kAbility) return static_cast<EliminationOrder*>(this);
    if (name == ManyRightHandSides::kAbility) return static_cast<ManyRightHandSides*>(this);
    if (name == Marginals::kAbility) return static_cast<Marginals*>(&marginals_);
    return nullptr;
  }

 private:
  std::string ordering_;
  bool is_mixed_;
  // In mixed precision the first log determinant factors anew.
  mutable block::ChainCholesky cholesky_;
  BlockMarginals marginals_{*this, cholesky_};
  LinearSolverStats stats_;
};

}  // namespace
}  // namespace cairn

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, BlockCholeskyOptions>(
      "block_cholesky",
      [](const BlockCholeskyOptions& options) { return std::make_unique<BlockCholesky>(options); });
}
