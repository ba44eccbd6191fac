// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "gauss_seidel_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, GaussSeidelOptions>(
      "gauss_seidel", [](const GaussSeidelOptions& options) {
        return std::make_unique<GaussSeidelSolver>(options);
      });
}
