// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <span>

namespace cairn::formats {

// Rotations as TORO and iSAM write them: R = Rz(yaw) Ry(pitch) Rx(roll), in radians.

/// qx qy qz qw of (roll, pitch, yaw).
std::array<double, 4> quaternion_from(std::span<const double, 3> roll_pitch_yaw);

/// The inverse, with |pitch| ≤ π/2; at a pitch of ±π/2, where only the difference or sum of roll
/// and yaw is determined, angles of the same rotation all the same.
std::array<double, 3> angles_from(std::span<const double, 4> quaternion);

}  // namespace cairn::formats
