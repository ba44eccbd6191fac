// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
// One file each.
void add_bench(Registrar& registrar);
void add_convert(Registrar& registrar);
void add_evaluate(Registrar& registrar);
void add_info(Registrar& registrar);
void add_marginals(Registrar& registrar);
void add_new_plugin(Registrar& registrar);
void add_optimize(Registrar& registrar);
void add_plugins(Registrar& registrar);
void add_study(Registrar& registrar);
}  // namespace cairn::app

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::app;
  add_bench(registrar);
  add_convert(registrar);
  add_evaluate(registrar);
  add_info(registrar);
  add_marginals(registrar);
  add_new_plugin(registrar);
  add_optimize(registrar);
  add_plugins(registrar);
  add_study(registrar);
}
