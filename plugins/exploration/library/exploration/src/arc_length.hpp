// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Of the arc along which a robot that can't turn in place makes a motion [m]; backwards it is
/// negative.
inline double arc_length(const Pose2& motion) {
  constexpr double kStraight = 1e-9;  // [rad]
  const double chord = std::copysign(motion.translation().norm(), motion.x());
  const double half = 0.5 * motion.theta();
  return std::abs(half) < kStraight ? chord : chord * half / std::sin(half);
}

}  // namespace cairn
