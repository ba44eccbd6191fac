// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
// One file each.
void add_sparsify(Registrar& registrar);
void add_study_problems(Registrar& registrar);
void add_study_sparsify(Registrar& registrar);
}  // namespace cairn::app

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::app;
  add_sparsify(registrar);
  add_study_problems(registrar);
  add_study_sparsify(registrar);
}
