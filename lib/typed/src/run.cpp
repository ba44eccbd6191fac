// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/run.hpp"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn {
namespace {

constexpr std::string_view kInitialGuess = "auto";
/// How it says that it has left the graph's states as they were, which is no news.
constexpr std::string_view kKept = "initial guess auto: as_given (";

bool is_interrupted(const Stop& stop) { return stop.interrupt && *stop.interrupt; }

bool has_guess(const Stop& stop, Registry& registry) {
  return !is_interrupted(stop) && registry.has(InitialGuess::kKind, kInitialGuess);
}

std::unique_ptr<Optimizer> make_optimizer(std::string_view spec, const Graph& graph,
                                          Registry& registry) {
  return registry.make<Optimizer>(
      with_suited_linear_solver(parse_component(spec), graph, registry));
}

}  // namespace

Summary optimize_from_states(Graph& graph, std::string_view optimizer, const Stop& stop,
                             Registry& registry) {
  const auto made = make_optimizer(optimizer, graph, registry);
  Observer silent;
  return optimize(graph, Optimization{*made, optimizer, nullptr, {}}, stop, silent);
}

Summary optimize(Graph& graph, std::string_view optimizer, const Stop& stop, Registry& registry) {
  const auto made =
      make_optimizer(optimizer, graph, registry);  // a wrong name is an error before the work
  if (!has_guess(stop, registry)) return optimize_from_states(graph, optimizer, stop, registry);
  const auto guess = registry.make<InitialGuess>(kInitialGuess);
  Observer silent;
  Summary summary =
      optimize(graph, Optimization{*made, optimizer, guess.get(), kInitialGuess}, stop, silent);
  std::erase_if(summary.notes, [](const std::string& note) { return note.starts_with(kKept); });
  return summary;
}

}  // namespace cairn
