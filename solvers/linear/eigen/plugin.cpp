// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "eigen_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "eigen",
      cairn::OptionTable{}.choice("ordering", "amd", {"amd", "natural"},
                                  "fill-reducing ordering, computed on the graph of the blocks"),
      [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<cairn::EigenSolver>(options.text("ordering"));
      });
}
