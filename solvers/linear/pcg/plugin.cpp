// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "pcg/block_jacobi.hpp"
#include "pcg/incomplete_cholesky.hpp"
#include "pcg/pcg_solver.hpp"
#include "pcg/subgraph.hpp"

namespace {

using namespace cairn;

/// What factorises the subgraph: nearly a tree, so any sparse Cholesky will do.
std::string subgraph_solver(const Registry& registry) {
  const bool ours = registry.has(LinearSolver::kKind, "block_cholesky");
  return ours ? "block_cholesky" : "eigen";
}

std::unique_ptr<Preconditioner> make_preconditioner(const PcgOptions& options, Registry& registry) {
  switch (options.preconditioner) {
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
