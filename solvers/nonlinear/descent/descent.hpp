// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/graph/free_directions.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/solve/optimizer.hpp"
#include "free_space.hpp"
#include "state_extent.hpp"
#include "stationary_factors.hpp"

namespace cairn {

/// Scalar product.
double dot(std::span<const double> a, std::span<const double> b);

/// Euclidean norm.
double norm(std::span<const double> a);

/// One run of a second-order optimizer, as far as the method does not matter: the normal equations,
/// the estimate and the best one met, the limits of `Stop`, the records of the iterations, and the
/// summary.
///
///     Descent run("gauss_newton", "block_cholesky", *solver, graph, stop, observer);
///     while (run.next_iteration()) { … run.record(…); … }
///     return run.finish();
///
/// A run ends by `end(status)`, by a limit, or because there is nothing to optimise; the graph gets
/// the best estimate in `finish`.
class Descent {
 public:
  /// Builds the normal equations, linearises once, and notifies the observer.
  Descent(std::string optimizer, std::string linear_solver, LinearSolver& solver, Graph& graph,
          const Stop& stop, Observer& observer);

  NormalEquations& equations() { return *equations_; }
  const NormalEquations& equations() const { return *equations_; }
  const Stop& stop() const { return stop_; }
  bool has_losses() const { return graph_.has_losses(); }
  bool gauge_is_left_free() const { return !equations_->gauge().left_free.empty(); }
  /// Stop.tolerance is 0: no test of convergence is to be made.
  bool exact() const { return !(stop_.tolerance > 0.0); }

  /// Whether chi2 may fall by no more than that before the run counts as converged.
  bool is_small(double decrease) const { return decrease <= stop_.tolerance * chi2; }

  /// The current estimate, with its chi2. Code that changes it must update chi2, H and g.
  Values estimate;
  double chi2 = 0.0;
  /// Room for a trial step.
  std::vector<double> step;
  Values trial;

  /// False when the run has ended or a limit is reached. Otherwise a new iteration begins.
  bool next_iteration();
  /// Whether the run, having ended as converged, is to go on: at its best estimate factors were
  /// stationary that are at no minimum (`leave_stationary_factors`), and the estimate is beside it
  /// now. Goes on from it as from an initial one; the better of both ends stays.
  bool begins_anew();
  /// Whether this is the last iteration that the limit allows: no need to linearise after it.
  bool last_iteration() const { return number_ >= stop_.max_iterations; }
  /// Checks the interrupt flag and the clock, between the parts of an iteration; ends the run if it
  /// must stop.
  bool must_stop();

  /// H and g at the estimate; sets chi2.
  void linearize();
  /// Factorises H, pinned where directions are free: the step then leaves these alone.
  Factorization factorize();
  /// What the measurements leave free at the estimate.
  const FreeDirections& free() const { return free_; }
  const FreeSpace& free_space() const { return free_space_; }
  /// Whether chi2 is what rounding of the states makes of zero, which a relative tolerance never
  /// reaches: asked where a step of this length is negligible.
  bool fits_exactly(double step_norm) const;
  /// Ends the run because it needs an H that is regular.
  void end_undetermined();

  /// Solves for `out` with what was factorised last. False if the result has numbers that are not
  /// finite, which more damping may cure. In the first iteration and some others a note names a
  /// linear solver whose result does not solve its system.
  bool solve(std::span<double> out);
  /// out = (what was factorised last)⁻¹ right.
  void solve_for(std::span<const double> right, std::span<double> out) {
    solver_.solve(right, out);
  }
  /// ‖out‖ of the last `solve`.
  double step_norm() const { return step_norm_; }
  /// Whether `out` solves its system (`NormalEquations::backward_error`), as a step must by which
  /// convergence is to be claimed; otherwise the run ends as diverged, with a note that names the
  /// linear solver. That of an iterative solver must have lowered the residual well below g, in the
  /// Euclidean norm and in that of the diagonal of H.
  bool solves(std::span<const double> out);
  /// Ends the run because no step that is finite could be had.
  void end_not_finite();
  /// Ends the run because no trial step lowers chi2. Converged if the first of them, from the
  /// present linearisation, was to lower it by little (`promise`) or was short (`step_norm`):
  /// what is left is rounding, of chi2 or of the coordinates. Otherwise the model is not that of
  /// the residuals: diverged. `is_damped`: as for `end_converged`.
  void end_without_descent(double promise, double step_norm, bool is_damped);

  /// Ends the run as converged; `is_damped`: by the predicted decrease of a step that only damping
  /// made possible, though the gauge is not free. Where the information of the factors differs by
  /// more than the digits of H can hold, that prediction is without the weakest factors, and no
  /// sign of a minimum: then H is not positive definite, and a note says what would help.
  void end_converged(bool is_damped);

  /// Remembers the estimate if its chi2 is the lowest so far; true if it is.
  bool keep_if_best();
  /// Records the iteration and notifies the observer, which may end the run.
  void record(double step_norm, double lambda, bool accepted);

  void end(Status status) { status_ = status; }
  bool ended() const { return status_.has_value(); }
  void note(std::string sentence) { summary_.notes.push_back(std::move(sentence)); }
  /// A note that is a reason to doubt the estimate (`Summary::doubts`).
  void doubt(std::string sentence) { summary_.doubt(std::move(sentence)); }
  /// Ends the run for a factorisation of H that failed, with a note that gives the reason.
  void end_not_positive_definite(const Factorization& failure);

  /// `cairn::state_extent`: the largest of the initial estimate and those of the first iterations.
  double state_extent() const { return state_extent_; }

  /// For each entry of the diagonal of H the least that it counts as in damping: 1e-12 of the
  /// largest entry of the same unit, that is, for the same number of the tangent space of the same
  /// type of variable; of the largest one of all where those are zero, and of 1 where H is zero.
  std::vector<double> min_diagonal() const;

  /// Leaves the best estimate in the graph.
  Summary finish();

 private:
  void begin_inside();
  /// What rounding of the estimate's numbers adds to chi2, as expected: Σ H_kk (2⁻⁵² |x|)² / 12,
  /// |x| the largest coordinate of a pose or point, 1 for orientations, else the largest number of
  /// the state.
  double coordinate_rounding() const;
  void choose_forcing();
  void solve_inexactly(std::span<double> out);
  bool is_solution(std::span<const double> out);
  void find_free();
  void note_wrong_step(const std::string& residual);
  /// ‖Hx − g‖ / ‖g‖ of the last step, in the worse of the two norms.
  double relative_residual() const;
  /// Whether all of Hx − g is what rounding leaves of a gradient that is zero, as at a minimum. A
  /// solver that works on the Jacobian never sees g, and its step is no worse for that.
  bool residual_is_rounding() const;

  using Clock = std::chrono::steady_clock;

  Graph& graph_;
  const Stop stop_;
  Observer& observer_;
  LinearSolver& solver_;
  Clock::time_point begin_;
  Clock::time_point iteration_begin_;
  std::optional<NormalEquations> equations_;
  FreeDirections free_;
  FreeSpace free_space_;
  Values best_;
  double best_chi2_ = 0.0;
  Departures departures_;
  int number_ = 0;
  double state_extent_ = 0.0;
  double step_norm_ = 0.0;
  double gradient_ = 0.0;         // ‖g‖ of the last step
  bool is_forced_ = false;        // an iterative solver has a forcing term
  std::vector<double> solution_;  // the last one as solved, where the step leaves something alone
  int sampled_ = 0;               // the last iteration whose step was checked
  bool reported_wrong_step_ = false;  // a note names the linear solver
  std::optional<Status> status_;
  Summary summary_;
};

}  // namespace cairn
