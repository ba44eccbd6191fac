// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "pcg/block_jacobi.hpp"
#include "pcg/incomplete_cholesky.hpp"
#include "pcg/pcg_solver.hpp"
#include "pcg/subgraph.hpp"

namespace {

using namespace cairn;

/// Incomplete Cholesky, unless columns have so many blocks that it costs as much as a factorisation
/// with fill; the matrix is then one block away from every other, and its diagonal blocks do.
class ByDensity final : public Preconditioner {
 public:
  void analyze(const BlockStructure& structure) override {
    if (structure.entries() > kManyBlocks * structure.blocks()) {
      chosen_ = std::make_unique<BlockJacobi>();
    } else {
      chosen_ = std::make_unique<IncompleteCholesky>();
    }
    chosen_->analyze(structure);
  }
  Factorization factorize(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal,
                          const NormalBlocks* factors) override {
    return chosen_->factorize(H, diagonal, factors);
  }
  double apply(std::span<const double> r, std::span<double> z) override {
    return chosen_->apply(r, z);
  }
  std::string note() const override { return chosen_ ? chosen_->note() : std::string(); }

 private:
  static constexpr std::int64_t kManyBlocks = 40;  // of a column
  std::unique_ptr<Preconditioner> chosen_;
};

/// What factorises the subgraph: nearly a tree, so any sparse Cholesky will do.
std::string subgraph_solver(const Registry& registry) {
  const bool ours = registry.has(LinearSolver::kKind, "block_cholesky");
  return ours ? "block_cholesky" : "eigen";
}

std::unique_ptr<Preconditioner> make_preconditioner(const PcgOptions& options, Registry& registry) {
  switch (options.preconditioner) {
    case Preconditioning::automatic:
      return std::make_unique<ByDensity>();
    case Preconditioning::block_jacobi:
      break;
    case Preconditioning::incomplete_cholesky:
      return std::make_unique<IncompleteCholesky>();
    case Preconditioning::subgraph:
      return std::make_unique<Subgraph>(registry.make<LinearSolver>(subgraph_solver(registry)),
                                        options.loops);
  }
  return std::make_unique<BlockJacobi>();
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<LinearSolver, PcgOptions>("pcg", [](const PcgOptions& options, Registry& registry) {
    return std::make_unique<PcgSolver>(make_preconditioner(options, registry), options);
  });
}
