// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "damping.hpp"

namespace cairn::incremental {

/// How far the solution of a system has come that goes on from one update to the next.
///
/// A *round* orders and factorises what has changed, steps, and evaluates the factors that have
/// moved; then it ends, or relinearises some factors or all and begins another one. If a round has
/// raised chi2 too much the solution goes on with damped rounds (Levenberg-Marquardt) of
/// everything.
struct Solution {
  enum class Stage : std::uint8_t {
    none,  ///< there is nothing to be solved
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
  double at_first = 0.0;   ///< the cost before the solution
  double before = 0.0;     ///< and before the round
  double tolerance = 0.0;  ///< of the step, see `Substitution::descend`
  int factors = 0;         ///< that it is about
  bool unproven = false;   ///< the estimate has moved, and chi2 was not evaluated since
  Damping damping{};
  std::vector<std::int32_t> looked_at{};  ///< factors of the last evaluation
  std::vector<double> gradients{};        ///< g of the sources after it, one after the other
  std::size_t next_gradient = 0;          ///< in `set_aside`

  void go_to(Stage other) {
    stage = other;
    next = 0;
  }
  bool busy() const { return stage != Stage::none; }
};

}  // namespace cairn::incremental
