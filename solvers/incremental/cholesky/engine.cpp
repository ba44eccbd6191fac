// SPDX-License-Identifier: BSD-3-Clause
#include "engine.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::incremental {
namespace {

/// Converged where everything is solved for: a step could lower chi2 by less than this fraction.
constexpr double kExact = 1e-12;
/// A factor of H does for another step where the first could gain less than this part of chi2 …
constexpr double kNear = 1e-2;
/// … and each other one less than this part of the last.
constexpr double kFast = 0.1;

const block::Kernels& kernels_named(const std::string& name) {
  const block::Kernels* kernels = block::choose_kernels(name.c_str());
  if (kernels) return *kernels;
  throw Error(ErrorCode::usage, "this machine cannot run the kernels '" + name + "'; use auto");
}

}  // namespace

Engine::Engine(const Settings& settings, std::shared_ptr<Rescuer> rescuer)
    : EngineState(settings, std::move(rescuer), kernels_named(settings.kernels)) {}

Engine::Engine(const Engine& other) : EngineState(other), graph_(other.graph_.clone()) {}

double Engine::rounding() {
  if (std::exchange(rounding_is_old_, false)) {
    rounding_scale_ = 0.0;
    for (int f = 0; f < admitted_; ++f)
      if (live_factor_[f]) rounding_scale_ += rounding_scale(f);
  }
  return kRounding * rounding_scale_;
}

/// The estimate from before this update; everything is then to be linearised anew.
void Engine::step_back() {
  substitution_.drop_deferred(tree_);
  states_.undo(
      [&](std::int32_t node, std::span<const double> lead) { motions_.undo(tree_, node, lead); });
}

/// Starts anew at the current estimate with an optimizer that never raises chi2.
void Engine::rescue(UpdateReport& report, double tolerance) {
  {
    const Timed timed(report.seconds.linearize);
    write_back();
    Graph graph = clean_graph();
    if (answers_) {
      graph.set_values(answers_->object([&] {
        optimize(graph, tolerance, report);
        return graph.values();
      }));
    } else {
      optimize(graph, tolerance, report);
    }
    load(std::move(graph), live_ids());
  }
  broken_ = !bring_factor_up_to_date(report) || undetermined_;
  report.ok = !broken_;
  if (!broken_) step_and_look(report);
}

void Engine::optimize(Graph& graph, double tolerance, UpdateReport& report) {
  const std::lock_guard lock(rescuer_->mutex);
  const Summary summary =
      rescuer_->optimizer->optimize(graph, {.max_iterations = 100, .tolerance = tolerance});
  report.iterations += static_cast<int>(summary.iterations.size());
  report.converged = summary.status == Status::converged;
  if (!report.converged)
    report.doubt(fmt::format("not converged: {} after {} iterations", to_string(summary.status),
                             summary.iterations.size()));
}

void Engine::keep_answers(Answers* answers) {
  answers_.in(answers);
  models_.keep_answers(answers);
  pace_.keep_answers(answers);
}

void Engine::add_source(std::int32_t v) {
  if (held_[v] || is_source_[v]) return;
  is_source_[v] = 1;
  sources_.push_back(v);
}

/// Where something is taken out, what was little may have become much.
void Engine::bring_back() {
  for (int v = 0; v < states_.size(); ++v) {
    if (held_[v] || tree_.node_of(v) < 0 || !system_.has_set_aside(v)) continue;
    system_.count_all(v);
    add_source(v);
  }
}

std::vector<FactorId> Engine::live_ids() const {
  std::vector<FactorId> ids;
  for (std::size_t f = 0; f < ids_.size(); ++f) {
    if (live_factor_[f]) ids.push_back(ids_[f]);
  }
  return ids;
}

void Engine::compact() {
  if (dead_ == 0) return;
  Graph graph = snapshot();
  load(std::move(graph), live_ids());
}

/// Without what has been removed.
Graph Engine::clean_graph() const {
  Graph graph = graph_.clone();
  remove_dead(graph);
  return graph;
}

void Engine::remove_dead(Graph& graph) const {
  if (dead_ == 0) return;
  std::vector<bool> factors(live_factor_.size()), variables(live_variable_.size());
  for (std::size_t f = 0; f < factors.size(); ++f) factors[f] = !live_factor_[f];
  for (std::size_t v = 0; v < variables.size(); ++v) variables[v] = !live_variable_[v];
  graph.remove(factors, variables);
}

/// Steps with the factor at hand; near the minimum again, for as long as each can gain only a small
/// part of what the last one could. Whether that was next to nothing from the first: it is then the
/// factor of where the estimate has converged.
bool Engine::step_fully(UpdateReport& report) {
  for (int steps = 1;; ++steps) {
    const double last = decrease_, before = cost_;
    step_and_look(report);
    ++report.iterations;
    if (decrease_ <= kExact * cost_ + rounding()) return steps == 1;
    const bool fast = steps == 1 ? decrease_ <= kNear * cost_ : decrease_ <= kFast * last;
    if (!fast || !(cost_ <= before + rounding())) return false;
  }
}

void Engine::solve_fully(UpdateReport& report) {
  pace_.begin(0.0);
  settle_gauge();
  ++time_;
  states_.remember();
  if (broken_) return rescue(report, kExact);
  structure_changed_ = true;
  for (int round = 0; round < 50; ++round) {
    {
      const Timed timed(report.seconds.linearize);
      relinearize_all();
      report.relinearized_factors += live_factors_;
    }
    const double before = cost_;
    const bool ok = bring_factor_up_to_date(report);
    const bool converged = ok && step_fully(report);
    if (!ok || !(cost_ <= 1.01 * before + rounding())) {
      step_back();
      return rescue(report, kExact);
    }
    if (converged) return;
  }
  rescue(report, kExact);
}

std::vector<double> Engine::x(int v) const {
  std::vector<double> x(static_cast<std::size_t>(states_.ambient(v)));
  if (shown_) {
    std::copy_n(shown_->x(v), x.size(), x.begin());
  } else if (!motions_.read(tree_, states_, v, x.data())) {
    std::copy_n(states_.x(v), x.size(), x.begin());
  }
  return x;
}

double Engine::chi2() const {
  const Estimate estimate = current();
  double sum = 0.0;
  for (int f = 0; f < models_.size(); ++f) {
    if (live_factor_[f]) sum += models_.cost_now(f, graph_, estimate);
  }
  return sum;
}

/// The states as the graph's pools hold them.
Values Engine::values_of(const Estimate& estimate) const {
  Values values = graph_.values();
  for (int v = 0; v < estimate.size(); ++v) {
    const std::int32_t ambient = states_.ambient(v);
    std::copy_n(estimate.x(v), ambient,
                values.pools[graph_.pool(v)].begin() + std::ptrdiff_t{graph_.slot(v)} * ambient);
  }
  return values;
}

void Engine::write_back() {
  motions_.settle_all(tree_, states_);
  graph_.set_values(values_of(states_.estimate()));
}

Graph Engine::snapshot() const {
  Graph graph = graph_.clone();
  graph.set_values(values_of(current()));
  remove_dead(graph);
  return graph;
}

}  // namespace cairn::incremental
