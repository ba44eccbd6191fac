// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
// One file each.
void add_explore(Registrar& registrar);
void add_floor_input(Registrar& registrar);
void add_map(Registrar& registrar);
}  // namespace cairn::app

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::app;
  add_explore(registrar);
  add_floor_input(registrar);
  add_map(registrar);
}
