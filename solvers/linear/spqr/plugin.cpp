// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "spqr_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, SpqrOptions>(
      "spqr", [](const SpqrOptions& options) { return std::make_unique<SpqrSolver>(options); });
}
