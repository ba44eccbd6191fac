// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "gauss_seidel_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "gauss_seidel",
      cairn::OptionTable{}
          .real("tolerance", 1e-10, 1e-15, 1.0, "on the relative residual |Hx - g| / |g|")
          .integer("max_iterations", 0, 0, 1e12,
                   "sweeps (forwards and backwards) of one solve; 0: as many as 3e8 "
                   "multiplications allow; a step "
                   "that has not converged by then is used, and reported")
          .real("omega", 1.0, 1e-3, 1.999, "over-relaxation; 1 is Gauss-Seidel itself"),
      [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<cairn::GaussSeidelSolver>(
            options.real("omega"), cairn::iterative::RelaxationOptions{
                                       .tolerance = options.real("tolerance"),
                                       .max_iterations = options.integer("max_iterations")});
      });
}
