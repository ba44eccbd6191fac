// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "guesses.hpp"

namespace {

using namespace cairn;
using namespace cairn::initial;

/// make(), or null where it needs a plugin that this build lacks and the options did not name it.
template <class Make>
auto made_if_there(bool by_default, const Make& make) -> decltype(make()) {
  try {
    return make();
  } catch (const Error& error) {
    if (!by_default || error.code() != ErrorCode::plugin) throw;
    return nullptr;
  }
}

Candidates candidates(const AutomaticOptions& options, Registry& registry) {
  const AutomaticOptions defaults;
  const bool same_solver = options.linear_solver == defaults.linear_solver;
  const bool same_optimizer = options.optimizer == defaults.optimizer;
  const auto optimizer = [&] { return registry.make<Optimizer>(options.optimizer); };
  Candidates result;
  result.chordal = made_if_there(same_solver, [&] {
    return make_chordal({}, registry.make<LinearSolver>(options.linear_solver));
  });
  result.optimizer = made_if_there(same_optimizer, optimizer);
  const std::string other = options.optimizer.starts_with("dogleg") ? defaults.optimizer : "dogleg";
  result.make_other = [other, &registry] {
    return made_if_there(true, [&] { return registry.make<Optimizer>(other); });
  };
  result.incremental =
      made_if_there(same_optimizer, [&] { return make_incremental({.step = 0}, optimizer()); });
  result.small_steps =
      made_if_there(same_optimizer, [&] { return make_incremental({.step = 0}, optimizer(), 1); });
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
