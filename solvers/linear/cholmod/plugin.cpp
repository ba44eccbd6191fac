// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "cholmod_solver.hpp"

namespace {

cairn::CholmodMode mode_named(const std::string& name) {
  if (name == "simplicial") return cairn::CholmodMode::simplicial;
  if (name == "supernodal") return cairn::CholmodMode::supernodal;
  return cairn::CholmodMode::automatic;
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "cholmod",
      cairn::OptionTable{}
          .choice("mode", "auto", {"auto", "simplicial", "supernodal"},
                  "simplicial is column by column, supernodal by dense blocks through BLAS; auto "
                  "chooses by fill")
          .choice("ordering", "amd", {"amd", "csymamd", "metis", "nesdis", "natural"},
                  "fill-reducing ordering, computed on the graph of the blocks"),
      [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<cairn::CholmodSolver>(mode_named(options.text("mode")),
                                                      options.text("ordering"));
      });
}
