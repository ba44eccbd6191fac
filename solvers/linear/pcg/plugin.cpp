// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "pcg/block_jacobi.hpp"
#include "pcg/incomplete_cholesky.hpp"
#include "pcg/pcg_solver.hpp"
#include "pcg/subgraph.hpp"

namespace {

/// Who factorises the subgraph: nearly a tree, so any sparse Cholesky will do.
std::string subgraph_solver(const cairn::Registry& registry) {
  const bool ours = registry.has(cairn::LinearSolver::kKind, "block_cholesky");
  return ours ? "block_cholesky" : "eigen";
}

std::unique_ptr<cairn::Preconditioner> make_preconditioner(const cairn::Options& options,
                                                           cairn::Registry& registry) {
  const std::string& name = options.text("preconditioner");
  if (name == "incomplete_cholesky") return std::make_unique<cairn::IncompleteCholesky>();
  if (name == "subgraph") {
    return std::make_unique<cairn::Subgraph>(
        registry.make<cairn::LinearSolver>(subgraph_solver(registry)), options.real("loops"));
  }
  return std::make_unique<cairn::BlockJacobi>();
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "pcg",
      cairn::OptionTable{}
          .choice("preconditioner", "incomplete_cholesky",
                  {"block_jacobi", "incomplete_cholesky", "subgraph"},
                  "what is solved exactly in each iteration")
          .real("tolerance", 1e-10, 1e-15, 1.0, "on the relative residual |Hx - g| / |g|")
          .integer("max_iterations", 20000, 1, 1e9,
                   "of one solve; a step that has not converged by then is used, and reported")
          .real("loops", 0.3, 0.0, 1e3,
                "subgraph: loop closures taken besides the spanning tree, as a fraction of the "
                "blocks"),
      [](const cairn::Options& options, cairn::Registry& registry) {
        return std::make_unique<cairn::PcgSolver>(
            make_preconditioner(options, registry),
            cairn::PcgOptions{.tolerance = options.real("tolerance"),
                              .max_iterations = options.integer("max_iterations")});
      });
}
