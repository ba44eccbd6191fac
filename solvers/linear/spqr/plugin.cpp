// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "spqr_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "spqr",
      cairn::OptionTable{}.choice(
          "ordering", "amd", {"amd", "metis", "nesdis", "colamd", "natural"},
          "fill-reducing column ordering, computed on the graph of the blocks"),
      [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<cairn::SpqrSolver>(options.text("ordering"));
      });
}
