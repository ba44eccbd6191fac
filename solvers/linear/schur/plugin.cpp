// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "schur_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "schur",
      cairn::OptionTable{}
          .component("linear_solver", "linear_solver", "block_cholesky",
                     "solves the reduced system")
          .choice("eliminate", "auto", {"auto", "smallest", "independent_set"},
                  "blocks that are eliminated first; auto: the smallest where they are most of all "
                  "and not adjacent, else an independent set")
          .choice("kernels", "auto", {"auto", "portable", "avx2", "avx512"},
                  "instruction set, as far as the machine has it"),
      [](const cairn::Options& options, cairn::Registry& registry) {
        return std::make_unique<cairn::SchurSolver>(
            registry.make<cairn::LinearSolver>(options.text("linear_solver")),
            options.text("eliminate"), options.text("kernels"));
      });
}
