// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
// One file each.
void add_study_objective(Registrar& registrar);
void add_study_optimality(Registrar& registrar);
}  // namespace cairn::app

void cairn_register(cairn::Registrar& registrar) {
  cairn::app::add_study_objective(registrar);
  cairn::app::add_study_optimality(registrar);
}
