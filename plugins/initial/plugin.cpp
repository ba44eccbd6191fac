// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "guesses.hpp"

namespace {

using namespace cairn;
using namespace cairn::initial;

/// Candidates by default need plugins that a build may lack: they are left out then.
Candidates candidates(const AutomaticOptions& options, Registry& registry) {
  const auto there = [&](std::string_view kind, const std::string& spec, const char* by_default) {
    return spec != by_default || registry.has(kind, spec);
  };
  const AutomaticOptions defaults;
  Candidates result;
  if (there(LinearSolver::kKind, options.linear_solver, defaults.linear_solver.c_str()))
    result.chordal = make_chordal({}, registry.make<LinearSolver>(options.linear_solver));
  if (there(Optimizer::kKind, options.optimizer, defaults.optimizer.c_str())) {
    result.optimizer = registry.make<Optimizer>(options.optimizer);
    result.incremental = make_incremental({.step = 0}, registry.make<Optimizer>(options.optimizer));
  }
  return result;
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<InitialGuess, AutomaticOptions>(
      "auto", [](const AutomaticOptions& options, Registry& registry) {
        return make_automatic(options, candidates(options, registry));
      });
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
