// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "lapack_solver.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "lapack",
      cairn::OptionTable{}.integer(
          "max_size", 8000, 1, 46000,
          "largest number of scalar unknowns: a dense matrix of 8000 takes 0.5 GB"),
      [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<cairn::LapackSolver>(options.integer("max_size"));
      });
}
