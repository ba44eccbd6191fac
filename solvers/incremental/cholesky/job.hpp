// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace cairn::incremental {

/// How far the solution of a system has come that goes on from one update to the next.
///
/// A *round* orders and factorises what has changed, steps, and evaluates the factors that have
/// moved; then it ends, or relinearises some factors or all and begins another one. If a round has
/// raised chi2 too much the job goes on with damped rounds (Levenberg-Marquardt) of everything.
struct Job {
  enum class Stage : std::uint8_t {
    none,  ///< there is no job
    order,
    factorize,
    // A step:
    right_hand_side,
    climb,
    descend,
    move_states,
    turn_models,  ///< those of factors that join what moves as a whole with the rest
    evaluate,
    // Whether there is to be another:
    gradient,
    decrement,
    set_aside,
    // What has moved, or everything:
    relinearize,
    follow_all,
    frame_all,
    linearize_all
  };
  Stage stage = Stage::none;
  std::size_t next = 0;  ///< what the stage is to go on with
  int rounds = 0;
  double at_first = 0.0;   ///< the cost before the job, …
  double before = 0.0;     ///< … and before the round
  double tolerance = 0.0;  ///< of the step, see `Tree::solve`
  double expected = 0.0;   ///< the cost after it, by the models
  double square = 0.0;     ///< of the mismatches, summed over …
  int compared = 0;        ///< … so many factors
  int factors = 0;         ///< that it is about
  bool unproven = false;   ///< the estimate has moved, and chi2 was not evaluated since

  // Damped rounds:
  enum class Damped : std::uint8_t {
    no,
    begun,  ///< everything is linearised where the last estimate that was accepted is
    tried,  ///< … or after a step from there
    last    ///< it has converged: H as it is
  };
  Damped damped = Damped::no;
  double lambda = 0.0;
  double growth = 2.0;          ///< of lambda, if the next step is rejected
  bool undamped_fails = false;  ///< has raised chi2 before
  bool converged = true;

  void go_to(Stage other) {
    stage = other;
    next = 0;
  }
};

}  // namespace cairn::incremental
