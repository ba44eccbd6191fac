// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
// One file each.
void add_compact(Registrar& registrar);
void add_study_compact(Registrar& registrar);
}  // namespace cairn::app

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::app;
  add_compact(registrar);
  add_study_compact(registrar);
}
