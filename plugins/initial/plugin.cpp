// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "guesses.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::initial;
  registrar.add<InitialGuess>("as_given", OptionTable{},
                              [](const Options&, Registry&) { return make_as_given(); });
  registrar.add<InitialGuess>("odometry", OptionTable{},
                              [](const Options&, Registry&) { return make_odometry(); });
  registrar.add<InitialGuess, SpanningTreeOptions>("spanning_tree", make_spanning_tree);
  registrar.add<InitialGuess, ChordalOptions>(
      "chordal", [](const ChordalOptions& options, Registry& registry) {
        return make_chordal(options, registry.make<LinearSolver>(options.linear_solver));
      });
  registrar.add<InitialGuess, IncrementalOptions>(
      "incremental", [](const IncrementalOptions& options, Registry& registry) {
        return make_incremental(options, registry.make<Optimizer>(options.optimizer));
      });
}
