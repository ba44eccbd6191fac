// SPDX-License-Identifier: BSD-3-Clause
#include "levenberg_marquardt.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "acceleration.hpp"
#include "convergence.hpp"
#include "damping.hpp"
#include "descent.hpp"

namespace cairn {
namespace {

/// Damping at which the run gives up: no step with more of it changes a state in double precision.
constexpr double kLargestLambda = 1e16;
/// Where undamped steps cannot be had, so many damped steps in a row that promise less than the
/// tolerance count as arrival, and one that is not even kept; only with damping as light as this,
/// which the first such promise brings about: under a heavy one every promise is small.
constexpr int kSmallPromises = 3;
constexpr double kLightDamping = 1e-8;

/// Whether undamped steps are likely to be good: H is regular, and chi2 close to quadratic, as it
/// is not under robust losses.
bool is_hopeful(Descent& descent) {
  return descent.equations().gauge().left_free.empty() && !descent.has_losses();
}

double initial_lambda(const LevenbergMarquardtOptions& options, Descent& descent) {
  if (options.initial_lambda > 0.0) return options.initial_lambda;
  if (!descent.equations().gauge().left_free.empty()) return 1e-4;
  return descent.has_losses() ? 1e-6 : 1e-10;
}

/// Undamped steps need an H that is not singular, or one whose null space is known.
bool may_go_undamped(Descent& descent) {
  return descent.equations().gauge().left_free.empty() ||
         (descent.free().complete && !descent.free().empty());
}

/// One run: the state that its iterations hand on.
class Run {
 public:
  Run(Descent& descent, const LevenbergMarquardtOptions& options)
      : run_(descent),
        equations_(descent.equations()),
        damping_(initial_lambda(options, descent), 1e-20, kLargestLambda, is_hopeful(descent)),
        may_go_undamped_(may_go_undamped(descent)),
        endgame_(may_go_undamped_ ? std::sqrt(descent.stop().tolerance) : 0.0),
        convergence_(descent.stop().tolerance),
        damped_by_(descent.step.size()),
        min_diagonal_(descent.min_diagonal()),
        may_step_beyond_(is_hopeful(descent)) {}

  void iterate() {
    const bool undamped = endgame_.active();
    const double lambda = undamped ? 0.0 : damping_.lambda();
    const Factorization factorization = factorize(lambda);
    if (!factorization.ok) {
      take_failure(factorization, undamped);
      run_.record(0.0, lambda, false);
      return;
    }
    if (run_.must_stop()) return;
    if (!run_.solve(run_.step)) {
      take_no_step(undamped);
      run_.record(0.0, lambda, false);
      return;
    }
    double step_norm = run_.step_norm();
    double promise = dot(equations_.g(), run_.step) + damping_energy();
    if (first_trial_) {
      first_promise_ = promise;
      first_norm_ = step_norm;
      first_lambda_ = lambda;
      first_trial_ = false;
    }
    acceleration_.aim(run_);
    bool arrived = undamped ? convergence_.arrived(promise, run_.chi2) : damped_arrival(promise);
    const bool fits = run_.fits_exactly(step_norm);  // chi2 is zero: the minimum, damped or not
    arrived = (arrived || fits) && acceleration_.may_end(run_) && run_.solves(run_.step);

    const std::optional<double> faster = acceleration_.take(run_);
    if (faster) {
      step_norm = norm(run_.step);
      promise = acceleration_.decrement();
    } else {
      equations_.retract(run_.estimate, run_.step, run_.trial);
    }
    const double trial_chi2 = faster ? *faster : equations_.chi2(run_.trial);
    if (run_.must_stop()) return;
    const bool lowered = trial_chi2 < run_.chi2;  // false for what is not a number
    const double gained = run_.chi2 - trial_chi2;
    const bool exhausted = convergence_.exhausted(lowered, step_norm, run_.state_extent());
    if (!run_.ended() && arrived) run_.end_converged(!fits && !undamped && may_go_undamped_);
    if (!run_.ended() && small_promises_ > 0 && !lowered && may_arrive_damped() &&
        run_.solves(run_.step))
      run_.end_converged(may_go_undamped_);
    if (!run_.ended() && exhausted && run_.solves(run_.step)) end_without_descent();

    if (!lowered && may_step_beyond(lambda) && std::isfinite(trial_chi2)) {
      if (step_beyond(lambda)) {
        run_.record(run_.step_norm(), lambda, true);
        return;
      }
      may_step_beyond_ = false;
    }
    const double before = run_.chi2;
    if (lowered) take_step(trial_chi2);
    if (undamped && !lowered) endgame_.fail();
    if (!undamped && lowered) {
      damping_.ease(gained / promise);
      if (!run_.exact()) endgame_.consider(gained / before);
    }
    if (!undamped && !lowered) raise_damping();
    if (!undamped && !lowered && !run_.is_small(promise)) may_lighten_ = false;
    if (may_lighten_ && run_.is_small(promise) && may_arrive_damped()) damping_.set(kLightDamping);
    run_.record(step_norm, lambda, lowered);
  }

 private:
  Factorization factorize(double lambda) {
    const std::span<const double> diagonal = equations_.diagonal();
    for (std::size_t k = 0; k < damped_by_.size(); ++k) {
      damped_by_[k] = lambda * std::max(diagonal[k], min_diagonal_[k]);
    }
    return lambda > 0.0 ? equations_.factorize_damped(damped_by_) : run_.factorize();
  }

  /// λ δᵀ D δ: with it the promise gᵀδ + λ δᵀDδ is what the undamped model says of the damped step.
  double damping_energy() const {
    double sum = 0.0;
    for (std::size_t k = 0; k < damped_by_.size(); ++k)
      sum += damped_by_[k] * run_.step[k] * run_.step[k];
    return sum;
  }

  bool damped_arrival(double promise) {
    const bool small = damping_.lambda() <= kLightDamping && run_.is_small(promise);
    small_promises_ = small ? small_promises_ + 1 : 0;
    return may_arrive_damped() && small_promises_ >= kSmallPromises;
  }
  bool may_arrive_damped() const {
    return !run_.exact() && (endgame_.ever_failed() || !may_go_undamped_);
  }

  bool may_step_beyond(double lambda) const {
    return may_step_beyond_ && lambda <= kLightDamping && !run_.ended() && !run_.last_iteration();
  }
  /// Where a step that is all but undamped raises chi2, a second one from there often leads below
  /// where the first began (the watchdog technique: Chamberlain, Powell, Lemaréchal, Pedersen
  /// 1982). If so, takes both; otherwise all is as it was.
  bool step_beyond(double lambda) {
    const double before = run_.chi2;
    Values begin = run_.estimate;
    std::swap(run_.estimate, run_.trial);
    run_.linearize();
    if (std::isfinite(run_.chi2) && factorize(lambda).ok && !run_.must_stop() &&
        run_.solve(run_.step)) {
      equations_.retract(run_.estimate, run_.step, run_.trial);
      if (const double beyond = equations_.chi2(run_.trial); beyond < before) {
        take_step(beyond);
        return true;
      }
    }
    run_.estimate = std::move(begin);
    run_.linearize();
    return false;
  }

  void take_step(double trial_chi2) {
    acceleration_.follow(run_);
    std::swap(run_.estimate, run_.trial);
    const bool final = run_.ended() || run_.last_iteration();
    run_.chi2 = trial_chi2;
    if (!final) run_.linearize();
    run_.keep_if_best();
    first_trial_ = true;
  }

  /// After a step that is none.
  void take_no_step(bool undamped) {
    if (run_.ended()) return;
    if (undamped) {
      endgame_.fail();
    } else if (damping_.at_limit()) {
      run_.end_not_finite();
    } else {
      damping_.raise();
    }
  }

  void raise_damping() {
    damping_.raise();
    if (damping_.at_limit() && !run_.ended() && !run_.exact() && run_.solves(run_.step))
      end_without_descent();
  }

  /// No step helps. Whether that is the minimum is asked of what H promises with as little damping
  /// as it can be factorised with: under a heavy one every promise is small.
  void end_without_descent() {
    bool is_damped = may_go_undamped_ && first_lambda_ > 0.0;
    for (const double lambda : {0.0, kLightDamping, 1e-6, 1e-4}) {
      if (lambda >= first_lambda_) break;
      if (lambda == 0.0 && !may_go_undamped_) continue;
      if (!factorize(lambda).ok || !run_.solve(run_.step)) continue;
      first_promise_ = dot(equations_.g(), run_.step) + damping_energy();
      first_norm_ = run_.step_norm();
      is_damped = is_damped && lambda > 0.0;
      break;
    }
    run_.end_without_descent(first_promise_, first_norm_, is_damped);
  }

  void take_failure(const Factorization& failure, bool undamped) {
    if (undamped) {
      endgame_.fail();
      if (!explained_) run_.note("without damping " + equations_.explain(failure));
      explained_ = true;
    } else if (damping_.at_limit()) {
      run_.end_not_positive_definite(failure);
    } else {
      damping_.raise();
    }
  }

  Descent& run_;
  NormalEquations& equations_;
  Damping damping_;
  bool may_go_undamped_;
  Endgame endgame_;
  Convergence convergence_;
  Acceleration acceleration_;
  std::vector<double> damped_by_;     // λ D
  std::vector<double> min_diagonal_;  // of D
  int small_promises_ = 0;
  bool may_lighten_ = true;  // until a step after that was in vain
  bool may_step_beyond_;     // likewise, if undamped steps are likely to be good
  bool first_trial_ = true;  // of the present linearisation; it promised:
  double first_promise_ = 0.0, first_norm_ = 0.0, first_lambda_ = 0.0;
  bool explained_ = false;
};

}  // namespace

LevenbergMarquardt::LevenbergMarquardt(std::unique_ptr<LinearSolver> solver,
                                       LevenbergMarquardtOptions options)
    : solver_(std::move(solver)), options_(std::move(options)) {}

Summary LevenbergMarquardt::optimize(Graph& graph, const Stop& stop, Observer& observer) {
  Descent descent("levenberg_marquardt", options_.linear_solver, *solver_, graph, stop, observer);
  do {
    Run run(descent, options_);
    while (descent.next_iteration()) run.iterate();
  } while (descent.begins_anew());
  return descent.finish();
}

}  // namespace cairn
