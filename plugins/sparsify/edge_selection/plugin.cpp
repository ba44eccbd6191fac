// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "edge_selections.hpp"

namespace {

using namespace cairn;
using namespace cairn::edges;

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<EdgeSelection, ConnectivityOptions>(
      "mac", [](const ConnectivityOptions& options, Registry& registry) {
        return std::make_unique<MaximalConnectivity>(
            options, registry.make<LinearSolver>(options.relaxation.linear_solver));
      });
  registrar.add<EdgeSelection, RelaxationOptions>(
      "l1", [](const RelaxationOptions& options, Registry& registry) {
        return std::make_unique<SparseWeights>(options,
                                               registry.make<LinearSolver>(options.linear_solver));
      });
  registrar.add<EdgeSelection, GainOptions>(
      "greedy_gain", [](const GainOptions& options, Registry& registry) {
        return std::make_unique<GreedyGain>(options,
                                            registry.make<LinearSolver>(options.linear_solver));
      });
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
