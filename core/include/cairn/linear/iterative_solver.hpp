// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Ability of an iterative linear solver, whose x meets a tolerance at best. A linear solver
/// without it is a direct one: its x is exact up to rounding. A comparison of all solvers on offer
/// leaves iterative ones out, since the time that they take depends on the graph's condition, not
/// on its size alone.
class CAIRN_API IterativeSolver {
 public:
  static constexpr std::string_view kAbility = "iterative";
  virtual ~IterativeSolver();
  /// A solve ends when ‖Hx − g‖/‖g‖ is at most this, or at a limit of iterations.
  virtual double tolerance() const = 0;
  /// The forcing term of an inexact Newton method (Dembo, Eisenstat, Steihaug 1982): from now on a
  /// solve may end at this ‖Hx − g‖/‖g‖ where that is more than the tolerance. 0 at first. False,
  /// and nothing changes, if the solver meets its tolerance all the same.
  virtual bool set_forcing(double /*term*/) { return false; }
};

}  // namespace cairn
