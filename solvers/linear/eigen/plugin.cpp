// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "eigen_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, EigenOptions>(
      "eigen", [](const EigenOptions& options) { return std::make_unique<EigenSolver>(options); });
}
