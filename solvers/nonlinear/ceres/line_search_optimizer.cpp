// SPDX-License-Identifier: BSD-3-Clause
#include "line_search_optimizer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "blas_threads.hpp"
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

/// A step of this fraction of the states is none: chi2 = 0 is never reached to a relative
/// tolerance.
constexpr double kNegligible = 1e-9;

using Clock = std::chrono::steady_clock;

template <class Enum>
Enum parsed(const std::string& name, bool (*parse)(std::string, Enum*)) {
  Enum value{};
  if (!parse(name, &value)) {
    throw Error(ErrorCode::usage,
                "optimizer ceres_line_search: this Ceres does not know '" + name + "'");
  }
  return value;
}

/// Norm of the step from one state of the graph to another, in the tangent spaces.
double step_norm(const Graph& graph, const Values& from, const Values& to) {
  double squares = 0.0;
  std::vector<double> delta;
  for (std::size_t pool = 0; pool < from.pools.size(); ++pool) {
    const VariablePool& variables = graph.variable_pools()[pool];
    delta.resize(variables.variables.size() * variables.type->tangent_size());
    variables.type->local(variables.variables.size(), from.pools[pool].data(),
                          to.pools[pool].data(), delta.data());
    for (const double x : delta) squares += x * x;
  }
  return std::sqrt(squares);
}

/// One optimisation. Ceres may end a search for reasons of its own (a restart of the direction that
/// fails, steps that rounding decides): then another is begun from there, as long as that lowers
/// chi2.
class Run final : public ceres::IterationCallback {
 public:
  Run(const Graph& graph, const Gauge& gauge, const LineSearchOptions& options, const Stop& stop,
      Observer& observer, Summary& summary)
      : values_(graph.values()),
        graph_(graph),
        gauge_(gauge),
        stop_(stop),
        observer_(observer),
        summary_(summary),
        decrement_(graph, gauge) {
    begin_inside(graph, gauge, values_, summary);
    if (options.direction == "bfgs" && decrement_.size() > options.max_size) {
      throw Error(
          ErrorCode::usage,
          fmt::format("optimizer ceres_line_search: direction=bfgs keeps a dense matrix of "
                      "{0} × {0}, more than max_size={1} allows; direction=lbfgs needs none",
                      decrement_.size(), options.max_size));
    }
    const TangentScaling scaling =
        options.scaling == "none" ? TangentScaling{}
                                  : decrement_.block_jacobi(graph, values_, residual_scale(graph));
    problem_.emplace(graph, gauge, values_, options.scaling == "none" ? nullptr : &scaling);
  }

  /// Searches until it has ended; what a plugin threw meanwhile is thrown then.
  Status minimise(ceres::Solver::Options options);
  void rethrow() const {
    problem_->rethrow();
    if (exception_) std::rethrow_exception(exception_);
  }
  Values take_values() { return std::move(values_); }
  double decrement_seconds() const { return decrement_.seconds(); }

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& ceres) override {
    try {
      record(ceres);
    } catch (...) {  // not through Ceres' frames, which are not ours
      exception_ = std::current_exception();
      status_ = Status::interrupted;
    }
    if (!status_ && stop_.interrupt && stop_.interrupt->load(std::memory_order_relaxed))
      status_ = Status::interrupted;
    return status_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  void start(double chi2);
  void record(const ceres::IterationSummary& ceres);
  /// Whether the predicted decrease is below the tolerance.
  bool converged();
  Status without_descent();
  int iterations() const { return static_cast<int>(std::ssize(summary_.iterations)); }

  Values values_;
  const Graph& graph_;
  const Gauge& gauge_;
  const Stop& stop_;
  Observer& observer_;
  Summary& summary_;
  NewtonDecrement decrement_;
  std::optional<CeresProblem> problem_;
  Values before_;  ///< the states of the last iteration
  bool started_ = false;
  double chi2_ = 0.0;
  int next_check_ = 0;  ///< the iteration from which on convergence is tested again
  std::optional<Status> status_;
  std::exception_ptr exception_;
};

void Run::start(double chi2) {
  started_ = true;
  chi2_ = chi2;
  observer_.on_start(graph_, summary_.initial_chi2);
}

void Run::record(const ceres::IterationSummary& ceres) {
  const double chi2 = 2.0 * ceres.cost / problem_->cost_scale();
  if (ceres.iteration == 0) {
    if (!started_) {
      start(chi2);
      if (!(stop_.interrupt && stop_.interrupt->load(std::memory_order_relaxed)) &&
          stop_.tolerance > 0.0 && converged())
        status_ = Status::converged;
    }
    before_ = values_;
    return;
  }
  const double fall = chi2_ - chi2;
  chi2_ = chi2;
  const Iteration iteration{.number = iterations() + 1,
                            .chi2 = chi2,
                            .step_norm = step_norm(graph_, before_, values_),
                            .seconds = ceres.iteration_time_in_seconds};
  before_ = values_;
  summary_.iterations.push_back(iteration);
  if (!observer_.on_iteration(iteration, graph_, values_)) {
    status_ = Status::interrupted;
    return;
  }
  // A factorisation costs as much as some ten iterations: it is worth that where an iteration gains
  // less than the tolerance, and after a tenth more iterations each time.
  const bool short_step =
      iteration.step_norm <= kNegligible * state_extent(graph_, gauge_, values_);
  if (stop_.tolerance > 0.0 && (fall <= stop_.tolerance * chi2 || short_step) &&
      iterations() >= next_check_) {
    next_check_ = iterations() + 1 + iterations() / 10;
    if (converged()) status_ = Status::converged;
  }
}

bool Run::converged() {
  if (!std::isfinite(chi2_)) return false;
  const NewtonStep step = decrement_.at(values_);
  return step.decrease <= stop_.tolerance * chi2_ ||
         step.norm <= kNegligible * state_extent(graph_, gauge_, values_);
}

/// Ceres has found no step that lowers chi2, not even along the gradient.
Status Run::without_descent() {
  const NewtonStep step = decrement_.at(values_);
  if (std::isfinite(chi2_) && std::isnan(step.decrease)) {
    summary_.doubt(
        "the line search has ended where H is not positive definite: factors that a robust loss "
        "weighs with zero hold nothing; begin nearer to the minimum, such as at that without loss");
    return Status::not_positive_definite;
  }
  const bool rounding = step.decrease <= kCeresRounding * chi2_ ||
                        step.norm <= kCeresRounding * state_extent(graph_, gauge_, values_);
  if (std::isfinite(chi2_) && rounding) return Status::converged;
  summary_.doubt(
      fmt::format("the line search finds no step that lowers chi2, though the model predicts a "
                  "decrease of {:.3g}",
                  step.decrease));
  return Status::diverged;
}

Status Run::minimise(ceres::Solver::Options options) {
  const Clock::time_point begin = Clock::now();
  options.callbacks.push_back(this);
  const QuietGlog quiet;
  while (true) {
    const double before = started_ ? chi2_ : std::numeric_limits<double>::infinity();
    const int done = iterations();
    options.max_num_iterations = stop_.max_iterations - done;
    if (stop_.max_seconds > 0.0)
      options.max_solver_time_in_seconds = std::max(0.0, stop_.max_seconds - seconds_since(begin));
    ceres::Solver::Summary report;
    const AsManyThreads as_many;
    ceres::Solve(options, &problem_->problem(), &report);
    summary_.seconds.linearize += report.jacobian_evaluation_time_in_seconds;
    summary_.seconds.analyze += report.preprocessor_time_in_seconds;
    summary_.seconds.update += report.residual_evaluation_time_in_seconds;
    if (summary_.notes.empty() || summary_.notes.back() != "Ceres: " + report.message)
      summary_.notes.push_back("Ceres: " + report.message);
    if (started_) values_ = before_;  // where Ceres reports a failure, it is back at the start
    if (status_) return *status_;
    rethrow();
    if (!started_) {
      // Where the gradient is zero Ceres ends before its first iteration, and where the residuals
      // are not finite.
      if (report.termination_type != ceres::CONVERGENCE) return Status::diverged;
      start(2.0 * report.initial_cost / problem_->cost_scale());
      return without_descent();
    }
    if (report.termination_type == ceres::NO_CONVERGENCE) return Status::max_iterations;
    if (stop_.tolerance > 0.0 && converged()) return Status::converged;
    if (iterations() == done || !(chi2_ < before)) return without_descent();
  }
}

}  // namespace

ceres::Solver::Options line_search_solver_options(const LineSearchOptions& options) {
  ceres::Solver::Options ceres;
  ceres.minimizer_type = ceres::LINE_SEARCH;
  ceres.line_search_direction_type =
      parsed(options.direction, ceres::StringToLineSearchDirectionType);
  ceres.line_search_type = parsed(options.line_search, ceres::StringToLineSearchType);
  ceres.nonlinear_conjugate_gradient_type =
      parsed(options.conjugate_gradient, ceres::StringToNonlinearConjugateGradientType);
  ceres.max_lbfgs_rank = options.rank;
  ceres.min_line_search_step_size = std::numeric_limits<double>::min();  // in units of Ceres' own
  ceres.logging_type = ceres::SILENT;
  ceres.minimizer_progress_to_stdout = false;
  // Whether it has converged is decided by the Newton decrement.
  ceres.function_tolerance = ceres.gradient_tolerance = ceres.parameter_tolerance = 0.0;
  ceres.update_state_every_iteration = true;  // observers see the states
  const bool quasi_newton = options.direction == "lbfgs" || options.direction == "bfgs";
  if (quasi_newton && options.line_search == "armijo") {
    throw Error(ErrorCode::usage,
                fmt::format("optimizer ceres_line_search: direction={} needs line_search=wolfe; "
                            "line_search=armijo is for direction=nonlinear_conjugate_gradient and "
                            "steepest_descent",
                            options.direction));
  }
  if (std::string problem; !ceres.IsValid(&problem)) {
    throw Error(ErrorCode::usage,
                "optimizer ceres_line_search: Ceres does not accept these options: " + problem);
  }
  return ceres;
}

LineSearchOptimizer::LineSearchOptimizer(const LineSearchOptions& options)
    : options_(options), ceres_(line_search_solver_options(options)) {
  keep_blas_to_one_thread();
}

Summary LineSearchOptimizer::optimize(Graph& graph, const Stop& stop, Observer& observer) {
  return with_departures(graph, stop, observer,
                         [this](Graph& g, const Stop& s, Observer& o) { return run(g, s, o); });
}

Summary LineSearchOptimizer::run(Graph& graph, const Stop& stop, Observer& observer) const {
  check(stop);
  const Clock::time_point begin = Clock::now();
  const Gauge gauge = resolve_gauge(graph);
  Summary summary = begin_summary("ceres_line_search", "none", graph, gauge, observer);
  if (!ends_at_once(graph, gauge, stop, observer, summary)) {
    Run run(graph, gauge, options_, stop, observer, summary);
    ceres::Solver::Options options = ceres_;
    options.num_threads = threads();
    summary.status = run.minimise(options);
    const double factorize = run.decrement_seconds();
    Values accepted = run.take_values();  // the last, also where something threw
    if (!accepted.pools.empty()) graph.set_values(std::move(accepted));
    run.rethrow();
    summary.final_chi2 = chi2(graph);
    if (summary.status == Status::converged && !std::isfinite(summary.final_chi2))
      summary.status = Status::diverged;
    note_free_directions(graph, gauge, summary);
    summary.seconds.factorize = factorize;
    summary.solver.note = fmt::format("{}, {}", options_.direction, options_.line_search);
  }
  summary.seconds.total = seconds_since(begin);
  return summary;
}

}  // namespace cairn
