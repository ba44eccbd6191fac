// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// The errors of a factor, not whitened, where one of its variables has moved by t.
using ErrorsAlong = std::function<std::vector<double>(double t)>;

/// What only an angle does that is not wrapped to ±π: it jumps by 2π elsewhere than between π and
/// −π.
struct AngleJump {
  int row = 0;
  double before = 0.0, after = 0.0;  ///< the error [rad]
  double moved = 0.0;                ///< the t at which it jumps
  bool of_a_turn = false;  ///< not a jump: the variable is back after a full turn, the error is not
};

/// The first such jump for t in [begin, end]; none: there is none. `turn`: at `end` the variable is
/// where it was at `begin`. Looks at 180 steps, and halves those with a change by more than π until
/// what is steep, and no jump, has shrunk.
CAIRN_API std::optional<AngleJump> find_angle_jump(const ErrorsAlong& errors, double begin,
                                                   double end, bool turn);

/// An `AngleJump` of a factor: while variable number `variable` moves along x · exp(t e_direction).
struct UnwrappedAngle {
  int variable = 0, direction = 0;
  AngleJump jump;
};

/// Verifies that the errors of any factor type which are angles are wrapped to ±π: moves each
/// variable by a full turn or, in directions that are not turns, along a line, from the states that
/// are given and from random ones around them, also with other measurements (that `normalize`
/// accepts). None: no error jumps as only an angle does that is not wrapped. Where the type throws
/// `Error` beside the states that are given, it is left out.
///
/// `variables`: the types, in the order of the factor. `x`: their states. Evaluates the factor some
/// 2,000 times for each degree of freedom.
///
///     EXPECT_FALSE(find_unwrapped_angle(*type, variables, states, z));
CAIRN_API std::optional<UnwrappedAngle> find_unwrapped_angle(
    const FactorType& type, std::span<const VariableType* const> variables,
    std::span<const double* const> x, std::span<const double> measurement);

/// "row 0 jumps from 3.9 to -2.38 where variable 1 moves by 0.2 in direction 2"
CAIRN_API std::string to_text(const UnwrappedAngle& angle);

}  // namespace cairn
