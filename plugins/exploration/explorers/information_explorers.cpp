// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "dopt.hpp"
#include "heuristic.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Explorer, HeuristicOptions>(
      "heuristic", [](const HeuristicOptions& options, Registry& registry) {
        return std::make_unique<Heuristic>(options, registry);
      });
  registrar.add<Explorer, DoptOptions>("dopt", [](const DoptOptions& options, Registry& registry) {
    return std::make_unique<Dopt>(options, registry);
  });
}
