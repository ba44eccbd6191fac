// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_run.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <glog/logging.h>

#include "cairn/graph/free_directions.hpp"
#include "domain_entry.hpp"

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
  Values inside = values;
  std::string moved = enter_domains(graph, gauge.held, inside);
  if (moved.empty()) return;
  Graph there = graph.clone();
  there.set_values(inside);
  if (!(chi2(there) < summary.initial_chi2)) return;
  values = std::move(inside);
  summary.notes.push_back(std::move(moved));
}

}  // namespace cairn
