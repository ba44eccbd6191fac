// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_optimizer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <iterator>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "blas_threads.hpp"
#include "cairn/graph/free_directions.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/timed.hpp"
#include "ceres_problem.hpp"
#include "ceres_run.hpp"
#include "newton_decrement.hpp"
#include "state_extent.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;

/// Hands Ceres' iterations to the observer, and the reasons to stop to Ceres.
class Bridge final : public ceres::IterationCallback {
 public:
  /// `cost_scale`: what Ceres' cost is multiplied by (`CeresProblem::cost_scale`).
  Bridge(const Graph& graph, const Values& values, double cost_scale, const Stop& stop,
         Observer& observer, Summary& summary)
      : graph_(graph),
        values_(values),
        cost_scale_(cost_scale),
        stop_(stop),
        observer_(observer),
        summary_(summary) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& ceres) override {
    try {
      tell(ceres);
    } catch (...) {  // not through Ceres' frames, which are not ours
      exception_ = std::current_exception();
      interrupted_ = true;
    }
    if (stop_.interrupt && stop_.interrupt->load(std::memory_order_relaxed)) interrupted_ = true;
    return interrupted_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

  bool interrupted() const { return interrupted_; }
  void rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  void tell(const ceres::IterationSummary& ceres) {
    // The cost of a step that was not taken is that of the trial.
    if (ceres.iteration == 0 || ceres.step_is_successful) chi2_ = 2.0 * ceres.cost / cost_scale_;
    if (ceres.iteration == 0) {
      observer_.on_start(graph_, summary_.initial_chi2);
      return;
    }
    const Iteration iteration{.number = ceres.iteration,
                              .chi2 = chi2_,
                              .step_norm = ceres.step_norm,
                              .lambda = 1.0 / ceres.trust_region_radius,
                              .accepted = ceres.step_is_successful,
                              .seconds = ceres.iteration_time_in_seconds};
    summary_.iterations.push_back(iteration);
    if (!observer_.on_iteration(iteration, graph_, values_)) interrupted_ = true;
  }

  const Graph& graph_;
  const Values& values_;
  const double cost_scale_;
  const Stop& stop_;
  Observer& observer_;
  Summary& summary_;
  double chi2_ = 0.0;
  bool interrupted_ = false;
  std::exception_ptr exception_;
};

double norm_of(const Values& values) {
  double squares = 0.0;
  for (const AlignedVector& pool : values.pools) {
    for (const double x : pool) squares += x * x;
  }
  return std::sqrt(squares);
}

/// Ceres compares what one damped step gains; ours promise what is left. A hundredth makes both end
/// alike.
constexpr double kToleranceShare = 1e-2;

/// Ceres' own test of a step is relative to the norm of all states, which is no measure of a map
/// far from the origin: `size` is what it is to be relative to.
double parameter_tolerance(const Stop& stop, const Values& values, double size) {
  const double norm = norm_of(values);
  if (!(stop.tolerance > 0.0) || !(norm > 0.0)) return 0.0;
  return 1e-15 * std::min(1.0, size / norm);
}

void set_limits(const Stop& stop, ceres::Solver::Options& options) {
  options.max_num_iterations = stop.max_iterations;
  options.function_tolerance = kToleranceShare * stop.tolerance;
  options.gradient_tolerance = 0.0;  // has units: no bound fits metres and radians
  if (stop.max_seconds > 0.0) options.max_solver_time_in_seconds = stop.max_seconds;
  options.num_threads = threads();
  options.update_state_every_iteration = true;  // observers see the states
}

Status status_of(const ceres::Solver::Summary& ceres, bool interrupted) {
  if (interrupted) return Status::interrupted;
  switch (ceres.termination_type) {
    case ceres::CONVERGENCE:
    case ceres::USER_SUCCESS:
      return Status::converged;
    case ceres::NO_CONVERGENCE:
      return Status::max_iterations;
    default:
      break;
  }
  // Ceres tells failures apart in words only. Before the first step it can only be the residuals.
  const bool took_steps = ceres.num_successful_steps + ceres.num_unsuccessful_steps > 1;
  return took_steps ? Status::not_positive_definite : Status::diverged;
}

/// Whether Ceres gave up shrinking its trust region, and calls that convergence, although the first
/// of its last steps that did not lower the cost was longer, and raised it by more, than rounding
/// explains: its Jacobians do not fit its residuals.
bool ended_without_descent(const ceres::Solver::Summary& ceres, double size) {
  const auto& all = ceres.iterations;
  auto first = all.end();
  while (first != all.begin() && !std::prev(first)->step_is_successful) --first;
  return first != all.end() && first->step_norm > kCeresRounding * size &&
         !(std::abs(first->cost_change) <= kCeresRounding * ceres.final_cost);
}

Seconds seconds_of(const ceres::Solver::Summary& ceres) {
  Seconds seconds;
  seconds.linearize = ceres.jacobian_evaluation_time_in_seconds;
  seconds.analyze = ceres.preprocessor_time_in_seconds;
  seconds.factorize =
      ceres.linear_solver_time_in_seconds;  // with its solves, which Ceres does not time apart
  seconds.update = ceres.residual_evaluation_time_in_seconds;
  return seconds;
}

}  // namespace

CeresOptimizer::CeresOptimizer(ceres::Solver::Options options) : options_(std::move(options)) {
  keep_blas_to_one_thread();
}

Summary CeresOptimizer::optimize(Graph& graph, const Stop& stop, Observer& observer) {
  return with_departures(graph, stop, observer,
                         [this](Graph& g, const Stop& s, Observer& o) { return run(g, s, o); });
}

Summary CeresOptimizer::run(Graph& graph, const Stop& stop, Observer& observer) const {
  check(stop);
  const Clock::time_point begin = Clock::now();
  const Gauge gauge = resolve_gauge(graph);
  Summary summary =
      begin_summary("ceres", ceres::LinearSolverTypeToString(options_.linear_solver_type), graph,
                    gauge, observer);
  if (ends_at_once(graph, gauge, stop, observer, summary)) {
    summary.seconds.total = seconds_since(begin);
    return summary;
  }

  Values values = graph.values();
  begin_inside(graph, gauge, values, summary);
  CeresProblem problem(graph, gauge, values);
  Bridge bridge(graph, values, problem.cost_scale(), stop, observer, summary);
  ceres::Solver::Options options = options_;
  set_limits(stop, options);
  const double extent = state_extent(graph, gauge, values);  // may be zero at the end
  options.parameter_tolerance = parameter_tolerance(stop, values, extent);
  options.callbacks.push_back(&bridge);
  ceres::Solver::Summary report;
  {
    const QuietGlog quiet;
    const AsManyThreads as_many;
    ceres::Solve(options, &problem.problem(), &report);
  }
  graph.set_values(std::move(values));  // the last that was accepted, also where something threw
  problem.rethrow();
  bridge.rethrow();

  summary.status = status_of(report, bridge.interrupted());
  summary.final_chi2 = chi2(graph);
  if (summary.status == Status::converged &&
      (!std::isfinite(summary.final_chi2) ||
       ended_without_descent(report, state_extent(graph, gauge, graph.values()))))
    summary.status = Status::diverged;
  summary.notes.push_back("Ceres: " + report.message);
  summary.seconds = seconds_of(report);
  summary.seconds.total = seconds_since(begin);  // without the question that is cairn's own
  if (summary.status == Status::converged && stop.tolerance > 0.0) {
    // A step may be short because the trust region is, or beside states far from the origin.
    const NewtonStep left = NewtonDecrement(graph, gauge).at(graph.values());
    if (left.decrease > kCeresRounding * summary.final_chi2 &&
        find_free_directions(graph, gauge, graph.values()).empty() &&
        left.norm > kCeresRounding * std::max(extent, state_extent(graph, gauge, graph.values()))) {
      summary.status = Status::diverged;
      summary.doubt(
          fmt::format("Ceres took a short step for convergence, but the model predicts a decrease "
                      "of {:.3g}",
                      left.decrease));
    }
  }
  note_free_directions(graph, gauge, summary);
  summary.solver.note = fmt::format(
      "{}, {}", ceres::LinearSolverTypeToString(report.linear_solver_type_used),
      ceres::SparseLinearAlgebraLibraryTypeToString(report.sparse_linear_algebra_library_type));
  return summary;
}

}  // namespace cairn
