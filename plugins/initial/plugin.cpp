// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "guesses.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using cairn::InitialGuess;
  using cairn::LinearSolver;
  using cairn::Optimizer;
  using cairn::Options;
  using cairn::OptionTable;
  using cairn::Registry;
  namespace initial = cairn::initial;

  registrar.add<InitialGuess>("as_given", OptionTable{},
                              [](const Options&, Registry&) { return initial::make_as_given(); });
  registrar.add<InitialGuess>("odometry", OptionTable{},
                              [](const Options&, Registry&) { return initial::make_odometry(); });
  registrar.add<InitialGuess>(
      "spanning_tree", initial::spanning_tree_options(),
      [](const Options& options, Registry&) { return initial::make_spanning_tree(options); });
  registrar.add<InitialGuess>(
      "chordal", initial::chordal_options(), [](const Options& options, Registry& registry) {
        return initial::make_chordal(options,
                                     registry.make<LinearSolver>(options.text("linear_solver")));
      });
  registrar.add<InitialGuess>("incremental", initial::incremental_options(),
                              [](const Options& options, Registry& registry) {
                                return initial::make_incremental(
                                    options, registry.make<Optimizer>(options.text("optimizer")));
                              });
}
