// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "gauss_newton.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Optimizer>(
      "gauss_newton",
      cairn::OptionTable{}
          .component("linear_solver", "linear_solver", "block_cholesky",
                     "solves the normal equations")
          .integer("rises", 8, 1, 1e6,
                   "iterations in a row in which chi2 may rise before the run counts as diverging"),
      [](const cairn::Options& options, cairn::Registry& registry) {
        const std::string& solver = options.text("linear_solver");
        return std::make_unique<cairn::GaussNewton>(
            registry.make<cairn::LinearSolver>(solver),
            cairn::GaussNewtonOptions{.linear_solver = solver,
                                      .rises = static_cast<int>(options.integer("rises"))});
      });
}
