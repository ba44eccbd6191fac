// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "lapack_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, LapackOptions>("lapack", [](const LapackOptions& options) {
    return std::make_unique<LapackSolver>(options);
  });
}
