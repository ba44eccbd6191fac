// SPDX-License-Identifier: BSD-3-Clause
#include "dogleg.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "acceleration.hpp"
#include "convergence.hpp"
#include "descent.hpp"
#include "path.hpp"

namespace cairn {
namespace {

/// One run: the state that its iterations hand on.
class Run {
 public:
  Run(Descent& descent, const DoglegOptions& options)
      : run_(descent),
        equations_(descent.equations()),
        convergence_(descent.stop().tolerance),
        path_(descent.step.size()),
        min_diagonal_(descent.min_diagonal()),
        radius_(std::max(options.initial_radius, std::sqrt(descent.chi2))) {}

  void iterate() {
    bool arrived = false, fits = false;
    const bool is_new = !path_is_current_;
    if (!path_is_current_) {
      if (!factorize() || run_.must_stop()) return;
      if (!run_.solve(path_.newton())) {
        if (!run_.ended()) run_.end_not_finite();
        return;
      }
      path_.prepare(equations_.H(), equations_.g(), equations_.diagonal(), min_diagonal_);
      path_is_current_ = true;
      newton_promise_ = dot(equations_.g(), path_.newton());
      newton_norm_ = run_.step_norm();
      acceleration_.aim(run_);
      fits = run_.fits_exactly(newton_norm_);  // chi2 is zero: the minimum, damped or not
      arrived =
          (convergence_.arrived(newton_promise_, run_.chi2) || fits) && acceleration_.may_end(run_);
      if (arrived && !run_.solves(path_.newton())) return;
    }
    const double radius = radius_;
    const DoglegPath::Step step = arrived ? path_.end(run_.step) : path_.at(radius, run_.step);
    run_.free_space().project(run_.step);
    double step_norm = norm(run_.step);
    if (!std::isfinite(step_norm)) {
      run_.doubt("the step is not finite");
      run_.end(Status::diverged);
      return;
    }
    const std::optional<double> faster = is_new ? acceleration_.take(run_) : std::nullopt;
    if (faster) {
      step_norm = norm(run_.step);
    } else {
      equations_.retract(run_.estimate, run_.step, run_.trial);
    }
    const double trial_chi2 = faster ? *faster : equations_.chi2(run_.trial);
    if (run_.must_stop()) return;

    const bool lowered = trial_chi2 < run_.chi2;  // false for what is not a number
    const bool exhausted = convergence_.exhausted(lowered, step_norm, run_.state_extent());
    if (arrived) {
      run_.end_converged(!fits && is_damped());
    } else if (exhausted && run_.solves(path_.newton())) {
      run_.end_without_descent(newton_promise_, newton_norm_, is_damped());
    }
    if (!faster)
      adapt_radius(lowered ? (run_.chi2 - trial_chi2) / step.promise : -1.0, step.length);
    if (lowered) take_step(trial_chi2);
    run_.record(step_norm, 1.0 / radius, lowered);
  }

 private:
  /// Factorises H, or where it is singular H + μD with the smallest μ that does: the path then ends
  /// at a damped step. False if none does.
  bool factorize() {
    Factorization factorization = run_.factorize();
    is_damped_ = !factorization.ok;
    if (factorization.ok) return true;
    if (!explained_) run_.note(equations_.explain(factorization) + "; steps are regularised");
    explained_ = true;
    std::vector<double> damping(run_.step.size());
    for (double mu = 1e-12; mu < 1.0; mu *= 100.0) {
      for (std::size_t k = 0; k < damping.size(); ++k) {
        damping[k] = mu * std::max(equations_.diagonal()[k], min_diagonal_[k]);
      }
      factorization = equations_.factorize_damped(damping);
      if (factorization.ok) return true;
    }
    run_.end_not_positive_definite(factorization);
    return false;
  }

  /// Though the gauge is not free: then H is singular as it should be.
  bool is_damped() const { return is_damped_ && equations_.gauge().left_free.empty(); }

  void take_step(double trial_chi2) {
    acceleration_.follow(run_);
    std::swap(run_.estimate, run_.trial);
    const bool final = run_.ended() || run_.last_iteration();
    run_.chi2 = trial_chi2;
    if (!final) run_.linearize();
    run_.keep_if_best();
    path_is_current_ = false;
  }

  void adapt_radius(double gain_ratio, double length) {
    if (!(gain_ratio >= 0.25)) radius_ = 0.25 * length;
    if (gain_ratio > 0.75) radius_ = std::max(radius_, 3.0 * length);
  }

  Descent& run_;
  NormalEquations& equations_;
  Convergence convergence_;
  Acceleration acceleration_;
  DoglegPath path_;
  std::vector<double> min_diagonal_;
  double newton_promise_ = 0.0, newton_norm_ = 0.0;  // of the full step
  double radius_;
  bool path_is_current_ = false;
  bool is_damped_ = false;  // what was factorised last
  bool explained_ = false;
};

}  // namespace

Dogleg::Dogleg(std::unique_ptr<LinearSolver> solver, DoglegOptions options)
    : solver_(std::move(solver)), options_(std::move(options)) {}

Summary Dogleg::optimize(Graph& graph, const Stop& stop, Observer& observer) {
  Descent descent("dogleg", options_.linear_solver, *solver_, graph, stop, observer);
  do {
    Run run(descent, options_);
    while (descent.next_iteration()) run.iterate();
  } while (descent.begins_anew());
  return descent.finish();
}

}  // namespace cairn
