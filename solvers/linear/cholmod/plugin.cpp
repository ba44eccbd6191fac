// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "cholmod_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, CholmodOptions>("cholmod", [](const CholmodOptions& options) {
    return std::make_unique<CholmodSolver>(options);
  });
}
