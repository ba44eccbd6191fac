// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "schur_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, SchurOptions>(
      "schur", [](const SchurOptions& options, Registry& registry) {
        return std::make_unique<SchurSolver>(registry.make<LinearSolver>(options.linear_solver),
                                             options);
      });
}
