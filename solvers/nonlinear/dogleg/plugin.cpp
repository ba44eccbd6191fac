// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "dogleg.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Optimizer>(
      "dogleg",
      cairn::OptionTable{}
          .component("linear_solver", "linear_solver", "block_cholesky",
                     "solves the normal equations")
          .real("initial_radius", 1e4, 1e-12, 1e30, "of the trust region, in the norm of diag(H)")
          .real("smallest_diagonal", 1e-6, 0.0, 1e30,
                "lower bound of the diagonal of H in that norm"),
      [](const cairn::Options& options, cairn::Registry& registry) {
        const std::string& solver = options.text("linear_solver");
        return std::make_unique<cairn::Dogleg>(
            registry.make<cairn::LinearSolver>(solver),
            cairn::DoglegOptions{.linear_solver = solver,
                                 .initial_radius = options.real("initial_radius"),
                                 .smallest_diagonal = options.real("smallest_diagonal")});
      });
}
