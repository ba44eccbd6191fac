// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "plans.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::floors;
  registrar.add<cairn::FloorPlan, RoomsOptions>(
      "rooms", [](const RoomsOptions& options) { return std::make_unique<Rooms>(options); });
  registrar.add<cairn::FloorPlan, CorridorOptions>("corridor", [](const CorridorOptions& options) {
    return std::make_unique<Corridor>(options);
  });
  registrar.add<cairn::FloorPlan, LoopOptions>(
      "loop", [](const LoopOptions& options) { return std::make_unique<Loop>(options); });
  registrar.add<cairn::FloorPlan, CaveOptions>(
      "cave", [](const CaveOptions& options) { return std::make_unique<Cave>(options); });
}
