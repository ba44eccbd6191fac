// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/optimization.hpp"

#include <iterator>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn {

std::vector<std::string> compute_guess(Graph& graph, InitialGuess& guess, std::string_view name,
                                       WatchedGuess::GoOn go_on) {
  if (auto* watched = query<WatchedGuess>(guess)) watched->watch(std::move(go_on));
  return call_plugin([&] { return fmt::format("initial guess '{}'", name); },
                     [&] { return guess.compute(graph); });
}

Summary optimize(Graph& graph, const Optimization& of, const Stop& stop, Observer& observer,
                 WatchedGuess::GoOn go_on) {
  if (!go_on && stop.interrupt)
    go_on = [interrupt = stop.interrupt](std::string_view, double) { return !interrupt->load(); };
  std::vector<std::string> notes;
  if (of.guess) notes = compute_guess(graph, *of.guess, of.guess_name, std::move(go_on));
  for (std::string& note : notes) note = fmt::format("initial guess {}: {}", of.guess_name, note);
  Summary summary = call_plugin([&] { return fmt::format("optimizer '{}'", of.optimizer_name); },
                                [&] { return of.optimizer.optimize(graph, stop, observer); });
  for (std::string& note : notes_on_the_end(summary, stop, graph))
    summary.notes.push_back(std::move(note));
  summary.notes.insert(summary.notes.begin(), notes.begin(), notes.end());
  return summary;
}

bool is_estimate(const Summary& summary, const Stop& stop) {
  return summary.status == Status::converged ||
         (summary.status == Status::max_iterations && !(stop.tolerance > 0.0));
}

std::vector<std::string> notes_on_the_end(const Summary& summary, const Stop& stop,
                                          const Graph& graph, std::string_view max_iterations) {
  std::vector<std::string> notes;
  if (summary.status == Status::interrupted) return notes;
  if (summary.status == Status::max_iterations && !is_estimate(summary, stop) &&
      std::ssize(summary.iterations) >= stop.max_iterations) {
    notes.push_back(
        fmt::format("stopped by {} {} before it converged", max_iterations, stop.max_iterations));
  }
  for (std::string& doubt : reasons_for_doubt(graph, summary.final_chi2))
    notes.push_back(std::move(doubt));
  return notes;
}

}  // namespace cairn
