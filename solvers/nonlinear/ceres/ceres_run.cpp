// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_run.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <glog/logging.h>

#include "cairn/graph/free_directions.hpp"
#include "domain_entry.hpp"
#include "stationary_factors.hpp"

namespace cairn {

QuietGlog::QuietGlog() : level_(FLAGS_minloglevel) { FLAGS_minloglevel = google::GLOG_FATAL; }
QuietGlog::~QuietGlog() { FLAGS_minloglevel = level_; }

Summary begin_summary(std::string_view optimizer, std::string_view linear_solver,
                      const Graph& graph, const Gauge& gauge, Observer& observer) {
  Summary summary;
  summary.optimizer = optimizer;
  summary.linear_solver = linear_solver;
  if (std::string sentence = gauge.describe(graph); !sentence.empty())
    summary.notes.push_back(std::move(sentence));
  if (std::ranges::all_of(gauge.held, [](bool held) { return held; }))
    summary.notes.push_back("nothing to optimise: every variable is constant");
  for (const std::string& sentence : summary.notes) observer.on_message(sentence);
  return summary;
}

void note_free_directions(const Graph& graph, const Gauge& gauge, Summary& summary) {
  if (!std::isfinite(summary.final_chi2)) return;
  std::string sentence = find_free_directions(graph, gauge, graph.values()).describe(graph);
  if (!sentence.empty()) summary.notes.push_back(std::move(sentence));
}

bool ends_at_once(const Graph& graph, const Gauge& gauge, const Stop& stop, Observer& observer,
                  Summary& summary) {
  const bool idle = std::ranges::all_of(gauge.held, [](bool held) { return held; });
  summary.initial_chi2 = summary.final_chi2 = chi2(graph);
  // Ceres ends the process for numbers that it does not expect.
  const bool finite = std::isfinite(summary.initial_chi2);
  if (!idle && stop.max_iterations > 0 && finite) return false;
  if (!finite) summary.doubt("chi2 of the initial estimate is not finite");
  summary.status = !finite ? Status::diverged : idle ? Status::converged : Status::max_iterations;
  observer.on_start(graph, summary.initial_chi2);
  return true;
}

void begin_inside(const Graph& graph, const Gauge& gauge, Values& values, Summary& summary) {
  Graph there = graph.clone();
  const auto chi2_of = [&](const Values& at) {
    there.set_values(at);
    return chi2(there);
  };
  Values inside = values;
  std::string moved = enter_domains(graph, gauge.held, inside);
  if (!moved.empty() && chi2_of(inside) < summary.initial_chi2) {
    values = std::move(inside);
    summary.notes.push_back(std::move(moved));
  }
  // Where a residual answers to no small motion, what it measures seems to be free.
  if (find_free_directions(graph, gauge, values).empty()) return;
  Departures departures;
  if (departures.depart_at_start(graph, gauge.held, chi2_of(values), chi2_of, values)) {
    Status status = Status::converged;
    const double reached = chi2_of(values);
    summary.notes.push_back(departures.conclude(graph, reached, reached, status));
  }
}

namespace {

/// Hands on the iterations of a run that goes on from another one, numbered after those.
class Continued final : public Observer {
 public:
  Continued(Observer& observer, int done) : observer_(observer), done_(done) {}
  void on_message(std::string_view) override {}
  bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& best) override {
    Iteration counted = iteration;
    counted.number += done_;
    return observer_.on_iteration(counted, graph, best);
  }

 private:
  Observer& observer_;
  int done_;
};

void append(const Summary& next, Summary& summary) {
  const auto done = static_cast<int>(std::ssize(summary.iterations));
  for (Iteration iteration : next.iterations) {
    iteration.number += done;
    summary.iterations.push_back(iteration);
  }
  summary.notes = next.notes;  // of the last run, which begins where the others have ended
  summary.seconds.total += next.seconds.total;
  summary.seconds.linearize += next.seconds.linearize;
  summary.seconds.analyze += next.seconds.analyze;
  summary.seconds.factorize += next.seconds.factorize;
  summary.seconds.solve += next.seconds.solve;
  summary.seconds.update += next.seconds.update;
}

}  // namespace

Summary with_departures(Graph& graph, const Stop& stop, Observer& observer,
                        const std::function<Summary(Graph&, const Stop&, Observer&)>& once) {
  Summary summary = once(graph, stop, observer);
  Departures departures;
  Status last = summary.status;
  double reached = summary.final_chi2;
  while (last == Status::converged && stop.tolerance > 0.0) {
    Stop rest = stop;
    rest.max_iterations -= static_cast<int>(std::ssize(summary.iterations));
    const Values best = graph.values();
    Values beside = best;
    if (rest.max_iterations <= 0 ||
        !departures.depart(graph, resolve_gauge(graph).held, summary.final_chi2, beside))
      break;
    graph.set_values(std::move(beside));
    Continued continued(observer, static_cast<int>(std::ssize(summary.iterations)));
    const Summary next = once(graph, rest, continued);
    last = next.status;
    reached = next.final_chi2;
    if (reached < summary.final_chi2) {
      append(next, summary);
      summary.final_chi2 = reached;
      summary.solver = next.solver;
    } else {
      graph.set_values(best);
    }
  }
  std::string departed = departures.conclude(graph, summary.final_chi2, reached, last);
  if (!departed.empty()) summary.notes.push_back(std::move(departed));
  summary.status = last;
  return summary;
}

}  // namespace cairn
