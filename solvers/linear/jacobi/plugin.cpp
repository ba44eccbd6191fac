// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "jacobi_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, JacobiOptions>("jacobi", [](const JacobiOptions& options) {
    return std::make_unique<JacobiSolver>(options);
  });
}
