// SPDX-License-Identifier: BSD-3-Clause
#include "gauss_newton.hpp"

#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "acceleration.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "convergence.hpp"
#include "descent.hpp"

namespace cairn {
namespace {

void end_diverged(Descent& run) {
  std::string sentence =
      "Gauss-Newton diverged: try levenberg_marquardt, dogleg or a better initial guess";
  if (const int free = std::isfinite(run.chi2) ? run.equations().free_directions() : -1; free > 0) {
    sentence += fmt::format("; {} gauge freedom{} likely", free, free == 1 ? " is" : "s are");
  }
  run.note(std::move(sentence));
  run.end(Status::diverged);
}

/// One run, from the present estimate.
void descend(Descent& run, LinearSolver& solver, int most_rises) {
  Convergence convergence(run.stop().tolerance);
  Acceleration acceleration;
  NormalEquations& equations = run.equations();
  bool best = true;
  int rises = 0;
  const bool regular = run.free().empty() || query<IterativeSolver>(solver);
  while (run.next_iteration()) {
    if (!regular) {
      run.end_undetermined();
      break;
    }
    if (const Factorization factorization = run.factorize(); !factorization.ok) {
      run.end_not_positive_definite(factorization);
      break;
    }
    if (run.must_stop()) break;
    if (!run.solve(run.step)) {
      if (!run.ended()) run.end_not_finite();
      break;
    }
    const double before = run.chi2;
    acceleration.aim(run);
    const bool arrived = (convergence.arrived(dot(equations.g(), run.step), before) ||
                          run.fits_exactly(run.step_norm())) &&
                         acceleration.may_end(run);
    const bool may_end =
        arrived || (!run.exact() && Convergence::negligible(run.step_norm(), run.state_extent()));
    if (may_end && !run.solves(run.step)) break;
    const bool faster = acceleration.take(run).has_value();
    const double step_norm = faster ? norm(run.step) : run.step_norm();
    if (!faster) equations.retract(run.estimate, run.step, run.trial);
    if (run.must_stop()) break;

    std::swap(run.estimate, run.trial);
    const bool final = arrived || run.last_iteration();
    acceleration.follow(run);
    run.chi2 = final ? equations.chi2(run.estimate) : equations.linearize(run.estimate);
    best = run.keep_if_best();
    rises = run.chi2 > before ? rises + 1 : 0;
    const bool exhausted = convergence.exhausted(best, step_norm, run.state_extent());
    if (!std::isfinite(run.chi2) ||
        (!run.exact() && !arrived && !exhausted && rises >= most_rises)) {
      end_diverged(run);
    } else if (arrived || exhausted) {
      run.end(Status::converged);
    }
    run.record(step_norm, 0.0, true);
  }
}

}  // namespace

GaussNewton::GaussNewton(std::unique_ptr<LinearSolver> solver, GaussNewtonOptions options)
    : solver_(std::move(solver)), options_(std::move(options)) {}

Summary GaussNewton::optimize(Graph& graph, const Stop& stop, Observer& observer) {
  Descent run("gauss_newton", options_.linear_solver, *solver_, graph, stop, observer);
  do {
    descend(run, *solver_, options_.rises);
  } while (run.begins_anew());
  return run.finish();
}

}  // namespace cairn
