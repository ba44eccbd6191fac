// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/optimization.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/second_look.hpp"
#include "cairn/evaluation/undetermined.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn {
namespace {

/// Whether at least half of the variables are points of which no factor joins two.
bool is_mostly_points(const Graph& graph) {
  const auto pools = graph.variable_pools();
  const auto of_points = [&](std::int32_t pool) {
    return is_point(*pools[static_cast<std::size_t>(pool)].type);
  };
  std::size_t points = 0;
  for (std::size_t k = 0; k < pools.size(); ++k) {
    if (of_points(static_cast<std::int32_t>(k))) points += pools[k].variables.size();
  }
  const auto joins_points = [&](const FactorPool& pool) {
    return pool.size() > 0 && std::ranges::count_if(pool.variable_pools, of_points) > 1;
  };
  return points > 0 && 2 * points >= static_cast<std::size_t>(graph.variable_count()) &&
         std::ranges::none_of(graph.factor_pools(), joins_points);
}

}  // namespace

ComponentSpec with_suited_linear_solver(ComponentSpec optimizer, const Graph& graph,
                                        Registry& registry) {
  constexpr const char *kOption = "linear_solver", *kOfPoints = "schur", *kSpec = "schur:dense=pcg";
  const OptionSpec* option = registry.options(Optimizer::kKind, optimizer.name).find(kOption);
  if (option && option->type == OptionType::component && is_mostly_points(graph) &&
      registry.has(LinearSolver::kKind, kOfPoints))
    optimizer.values.emplace(kOption, registry.has(LinearSolver::kKind, "pcg") ? kSpec : kOfPoints);
  return optimizer;
}

std::vector<std::string> compute_guess(Graph& graph, InitialGuess& guess, std::string_view name,
                                       WatchedGuess::GoOn go_on) {
  if (auto* watched = query<WatchedGuess>(guess)) watched->watch(std::move(go_on));
  return call_plugin([&] { return fmt::format("initial guess '{}'", name); },
                     [&] { return guess.compute(graph); });
}

namespace {

/// Counts the iterations of an optimisation on from those of the one before.
class Continued final : public Observer {
 public:
  Continued(Observer& observer, int before) : observer_(observer), before_(before) {}
  bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& values) override {
    Iteration later = iteration;
    later.number += before_;
    return observer_.on_iteration(later, graph, values);
  }

 private:
  Observer& observer_;
  int before_;
};

void add(const Seconds& more, Seconds& seconds) {
  seconds.total += more.total;
  seconds.linearize += more.linearize;
  seconds.analyze += more.analyze;
  seconds.factorize += more.factorize;
  seconds.solve += more.solve;
  seconds.update += more.update;
}

void append(std::vector<std::string> more, std::vector<std::string>& sentences) {
  std::ranges::move(more, std::back_inserter(sentences));
}

/// Goes on from the graph's states, to the end of what `summary` begins.
void go_on_from(Graph& graph, const Optimization& of, const Stop& stop, Observer& observer,
                Summary& summary) {
  const auto before = static_cast<int>(summary.iterations.size());
  Continued continued(observer, before);
  Summary more = call_plugin([&] { return fmt::format("optimizer '{}'", of.optimizer_name); },
                             [&] { return of.optimizer.optimize(graph, stop, continued); });
  for (Iteration& iteration : more.iterations) {
    iteration.number += before;
    summary.iterations.push_back(iteration);
  }
  for (std::string& note : more.notes) {
    if (std::ranges::find(summary.notes, note) == summary.notes.end())
      summary.notes.push_back(std::move(note));
  }
  summary.doubts = std::move(more.doubts);  // those before were of an estimate that is left
  add(more.seconds, summary.seconds);
  summary.status = more.status;
  summary.final_chi2 = more.final_chi2;
  summary.solver = more.solver;
}

bool is_interrupted(const Stop& stop) { return stop.interrupt && stop.interrupt->load(); }

}  // namespace

void look_again(Graph& graph, const Optimization& of, const Stop& stop, Observer& observer,
                WatchedGuess::GoOn go_on, Summary& summary) {
  auto* second = of.guess ? query<SecondLook>(*of.guess) : nullptr;
  if (!second || summary.status != Status::converged || !(stop.tolerance > 0.0)) return;
  const auto begin = std::chrono::steady_clock::now();
  const double limit = stop.max_seconds - summary.seconds.total;
  if (auto* watched = query<WatchedGuess>(*of.guess)) {
    watched->watch([&](std::string_view what, double part) {
      return !is_interrupted(stop) && (!go_on || go_on(what, part)) &&
             (stop.max_seconds <= 0.0 || seconds_since(begin) < limit);
    });
  }
  SecondLook::Result found =
      call_plugin([&] { return fmt::format("initial guess '{}'", of.guess_name); },
                  [&] { return second->look_again(graph, summary); });
  if (auto* watched = query<WatchedGuess>(*of.guess)) watched->watch({});
  summary.seconds.total += seconds_since(begin);
  if (is_interrupted(stop)) summary.status = Status::interrupted;
  for (const std::string& note : found.notes)
    summary.notes.push_back(fmt::format("initial guess {}: {}", of.guess_name, note));
  if (found.lower && summary.status == Status::converged)
    go_on_from(graph, of, stop, observer, summary);
  if (!found.doubt.empty())
    summary.doubt(fmt::format("initial guess {}: {}", of.guess_name, found.doubt));
  if (found.lower && summary.status == Status::interrupted) summary.final_chi2 = chi2(graph);
}

Summary optimize(Graph& graph, const Optimization& of, const Stop& stop, Observer& observer,
                 WatchedGuess::GoOn go_on) {
  if (!go_on && stop.interrupt)
    go_on = [interrupt = stop.interrupt](std::string_view, double) { return !interrupt->load(); };
  std::vector<std::string> notes;
  if (of.guess) notes = compute_guess(graph, *of.guess, of.guess_name, go_on);
  for (std::string& note : notes) note = fmt::format("initial guess {}: {}", of.guess_name, note);
  Summary summary = call_plugin([&] { return fmt::format("optimizer '{}'", of.optimizer_name); },
                                [&] { return of.optimizer.optimize(graph, stop, observer); });
  look_again(graph, of, stop, observer, std::move(go_on), summary);
  note_the_end(summary, stop, graph);
  summary.notes.insert(summary.notes.begin(), notes.begin(), notes.end());
  return summary;
}

bool is_estimate(const Summary& summary, const Stop& stop) {
  return summary.status == Status::converged ||
         (summary.status == Status::max_iterations && !(stop.tolerance > 0.0));
}

void note_the_end(Summary& summary, const Stop& stop, const Graph& graph,
                  std::string_view max_iterations) {
  if (summary.status == Status::interrupted) return;
  if (summary.status == Status::max_iterations && !is_estimate(summary, stop) &&
      std::ssize(summary.iterations) >= stop.max_iterations) {
    summary.doubt(
        fmt::format("stopped by {} {} before it converged", max_iterations, stop.max_iterations));
  }
  NotesOnEstimate of_estimate = notes_on_estimate(graph, summary.final_chi2);
  append(std::move(of_estimate.notes), summary.notes);
  append(std::move(of_estimate.doubts), summary.doubts);
  if (losses_weigh_nothing(graph).empty())    // else everything is free
    note_what_is_free(graph, summary.notes);  // the optimizer may have said it
}

}  // namespace cairn
