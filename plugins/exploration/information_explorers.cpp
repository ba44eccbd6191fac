// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "heuristic.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Explorer, HeuristicOptions>(
      "heuristic", [](const HeuristicOptions& options, Registry& registry) {
        return std::make_unique<Heuristic>(options, registry);
      });
}
