// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
// One file each.
void add_online(Registrar& registrar);
void add_replay(Registrar& registrar);
}  // namespace cairn::app

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::app;
  add_online(registrar);
  add_replay(registrar);
}
