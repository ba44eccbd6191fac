// SPDX-License-Identifier: BSD-3-Clause
#include "engine.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "covariance_blocks.hpp"

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
    : settings_(settings),
      rescuer_(std::move(rescuer)),
      problem_(kernels_named(settings.kernels)),
      prediction_(settings.accuracy) {}

// --- what is there ---

std::vector<double> Engine::x(int v) const {
  if (!shown_) return problem_.x(v);
  const double* const x = shown_->x(v);
  return {x, x + problem_.states.ambient(v)};
}

double Engine::chi2() const {
  const Estimate estimate = current();
  double sum = 0.0;
  for (int f = 0; f < problem_.models.size(); ++f) {
    if (problem_.live_factor(f)) sum += problem_.models.cost_now(f, graph(), estimate);
  }
  return sum;
}

bool Engine::covariance(int a, int b, double* block) {
  return usable_for(b) && incremental::covariance(problem_, a, b, block);
}

bool Engine::covariance_column(std::span<const std::int32_t> rows, int b, double* column) {
  return usable_for(b) && incremental::covariance_column(problem_, rows, b, column);
}

void Engine::keep_answers(Answers* answers) {
  answers_.in(answers);
  problem_.models.keep_answers(answers);
  pace_.keep_answers(answers);
}

// --- changes ---

void Engine::added_variable() {
  problem_.add_variable();
  if (shown_) shown_->add(graph().state(problem_.states.size() - 1));
}

void Engine::added_factor() {
  problem_.add_factor(next_id_++);
  if (busy()) {
    pending_.note(problem_, problem_.models.size() - 1, [this](std::int32_t v) { return x(v); });
  } else {
    problem_.admit_waiting();
  }
}

bool Engine::mostly_dead() const {
  return 2 * problem_.dead() > problem_.states.size() + problem_.models.size();
}

void Engine::compact() {
  if (problem_.dead() > 0) load(snapshot(), problem_.live_ids());
}

void Engine::set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which) {
  Graph graph = snapshot();
  graph.set_loss(loss, which);
  load(std::move(graph), problem_.live_ids());
}

/// Starts from a whole graph, at its states.
void Engine::load(Graph graph, std::span<const FactorId> ids) {
  problem_ = problem_.anew(std::move(graph), ids, answers_.get());
  prediction_ = CostPrediction(settings_.accuracy);
  solution_ = {};
  pending_ = {};
  shown_.reset();
  broken_ = exhausted_ = false;
  ++loads_;
}

Elimination Engine::eliminate(std::span<const int> variables) {
  if (!answers_) return problem_.eliminate(variables);
  return answers_->object([&] { return problem_.eliminate(variables); });
}

// --- solving everything ---

/// The estimate from before this update; everything is then to be linearised anew.
void Engine::step_back() {
  problem_.substitution.drop_deferred(problem_.tree);
  problem_.states.undo([&](std::int32_t node, std::span<const double> lead) {
    problem_.motions.undo(problem_.tree, node, lead);
  });
}

/// Starts anew at the current estimate with an optimizer that never raises chi2.
void Engine::rescue(UpdateReport& report, double tolerance) {
  {
    const Timed timed(report.seconds.linearize);
    problem_.settle_all();
    Graph graph = problem_.clean_graph(problem_.states.estimate());
    if (answers_) {
      graph.set_values(answers_->object([&] {
        optimize(graph, tolerance, report);
        return graph.values();
      }));
    } else {
      optimize(graph, tolerance, report);
    }
    load(std::move(graph), problem_.live_ids());
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

/// Steps with the factor at hand; near the minimum again, for as long as each can gain only a small
/// part of what the last one could. Whether that was next to nothing from the first: it is then the
/// factor of where the estimate has converged.
bool Engine::step_fully(UpdateReport& report) {
  for (int steps = 1;; ++steps) {
    const double last = prediction_.decrease(), before = problem_.cost();
    step_and_look(report);
    ++report.iterations;
    const double decrease = prediction_.decrease(), cost = problem_.cost();
    if (decrease <= kExact * cost + problem_.rounding()) return steps == 1;
    const bool fast = decrease <= (steps == 1 ? kNear * cost : kFast * last);
    if (!fast || !(cost <= before + problem_.rounding())) return false;
  }
}

void Engine::solve_fully(UpdateReport& report) {
  pace_.begin(0.0);
  problem_.begin_solution();
  if (broken_) return rescue(report, kExact);
  problem_.change.of_structure = true;
  for (int round = 0; round < 50; ++round) {
    relinearize_all(report);
    const double before = problem_.cost();
    const bool ok = bring_factor_up_to_date(report);
    const bool converged = ok && step_fully(report);
    if (!ok || !(problem_.cost() <= 1.01 * before + problem_.rounding())) {
      step_back();
      return rescue(report, kExact);
    }
    if (converged) return;
  }
  rescue(report, kExact);
}

}  // namespace cairn::incremental
