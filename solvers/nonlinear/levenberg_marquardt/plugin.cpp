// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "levenberg_marquardt.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Optimizer>(
      "levenberg_marquardt",
      cairn::OptionTable{}
          .component("linear_solver", "linear_solver", "block_cholesky",
                     "solves the normal equations")
          .real("initial_lambda", 0.0, 0.0, 1e16,
                "damping of the first step, as a fraction of the diagonal of H; 0: 1e-6, or 1e-4 "
                "where the gauge is left free")
          .real("largest_lambda", 1e16, 1.0, 1e30, "damping at which the run gives up")
          .real("smallest_diagonal", 1e-6, 0.0, 1e30,
                "lower bound of the diagonal of H in the damping")
          .boolean("endgame", true,
                   "undamped steps near the minimum, which also judge convergence"),
      [](const cairn::Options& options, cairn::Registry& registry) {
        const std::string& solver = options.text("linear_solver");
        return std::make_unique<cairn::LevenbergMarquardt>(
            registry.make<cairn::LinearSolver>(solver),
            cairn::LevenbergMarquardtOptions{.linear_solver = solver,
                                             .initial_lambda = options.real("initial_lambda"),
                                             .largest_lambda = options.real("largest_lambda"),
                                             .smallest_diagonal = options.real("smallest_diagonal"),
                                             .endgame = options.boolean("endgame")});
      });
}
