// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <utility>

#include "cairn/plugin/registry.hpp"
#include "schur_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<LinearSolver, SchurOptions>(
      "schur", [](const SchurOptions& options, Registry& registry) {
        auto of_dense =
            options.dense == "pcg" ? registry.make<LinearSolver>("pcg:inexact=true") : nullptr;
        return std::make_unique<SchurSolver>(registry.make<LinearSolver>(options.linear_solver),
                                             std::move(of_dense), options);
      });
}
