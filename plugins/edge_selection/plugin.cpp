// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>

#include "cairn/plugin/registry.hpp"
#include "edge_selections.hpp"

namespace {

using namespace cairn;
using namespace cairn::edges;

/// A selection with one linear solver.
template <class Which, class Struct>
void add_with_solver(Registrar& registrar, const char* name) {
  registrar.add<EdgeSelection, Struct>(name, [](const Struct& options, Registry& registry) {
    return std::make_unique<Which>(options, registry.make<LinearSolver>(options.linear_solver));
  });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add_with_solver<MaximalConnectivity, ConnectivityOptions>(registrar, "mac");
  add_with_solver<SparseWeights, SparseWeightsOptions>(registrar, "l1");
  add_with_solver<GreedyGain, GainOptions>(registrar, "greedy_gain");
  registrar.add<EdgeSelection, TreeOptions>(
      "greedy_tree", [](const TreeOptions& options, Registry& registry) {
        return std::make_unique<GreedyTreeConnectivity>(
            options, registry.make<LinearSolver>(options.linear_solver),
            registry.make<LinearSolver>(options.linear_solver));
      });
  registrar.add<EdgeSelection, RandomOptions>("random", [](const RandomOptions& options) {
    return std::make_unique<RandomEdges>(options);
  });
}
