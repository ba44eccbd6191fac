// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/run.hpp"

#include <string>
#include <utility>
#include <vector>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn {
namespace {

constexpr std::string_view kInitialGuess = "auto";

bool is_interrupted(const Stop& stop) { return stop.interrupt && *stop.interrupt; }

/// Lets `auto` replace the states. Returns its notes, or none where it leaves them as they are.
std::vector<std::string> choose_start(Graph& graph, const Stop& stop, Registry& registry) {
  if (!registry.has(InitialGuess::kKind, kInitialGuess)) return {};
  const auto guess = registry.make<InitialGuess>(kInitialGuess);
  const Values given = graph.values();
  std::vector<std::string> notes =
      compute_guess(graph, *guess, kInitialGuess,
                    [&](std::string_view, double) { return !is_interrupted(stop); });
  if (graph.values().pools == given.pools) return {};
  for (std::string& note : notes) note = "initial guess auto: " + note;
  return notes;
}

/// From the graph's states.
Summary run(Graph& graph, Optimizer& optimizer, std::string_view name, const Stop& stop) {
  Observer silent;
  return optimize(graph, Optimization{optimizer, name, nullptr, {}}, stop, silent);
}

}  // namespace

Summary optimize_from_states(Graph& graph, std::string_view optimizer, const Stop& stop,
                             Registry& registry) {
  return run(graph, *registry.make<Optimizer>(optimizer), optimizer, stop);
}

Summary optimize(Graph& graph, std::string_view optimizer, const Stop& stop, Registry& registry) {
  const auto made =
      registry.make<Optimizer>(optimizer);  // a wrong name is an error before the work
  std::vector<std::string> notes;
  if (!is_interrupted(stop)) notes = choose_start(graph, stop, registry);
  Summary summary = run(graph, *made, optimizer, stop);
  summary.notes.insert(summary.notes.begin(), notes.begin(), notes.end());
  return summary;
}

}  // namespace cairn
