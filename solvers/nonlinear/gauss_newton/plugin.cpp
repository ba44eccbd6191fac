// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "gauss_newton.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<Optimizer, GaussNewtonOptions>(
      "gauss_newton", [](const GaussNewtonOptions& options, Registry& registry) {
        return std::make_unique<GaussNewton>(registry.make<LinearSolver>(options.linear_solver),
                                             options);
      });
}
