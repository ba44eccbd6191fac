// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <span>

namespace cairn::formats {

/// A camera as BAL writes it: rotation vector ω [rad] and translation T with P = exp(ω) X + T, then
/// f [px], k1, k2.
using BalCamera = std::array<double, 9>;

/// The state of a VERTEX_CAMERA_BAL: f k1 k2, then position and quaternion of the camera in the
/// world. All numbers must be finite.
void to_state(const BalCamera& camera, std::span<double> state);
/// The inverse; rotation and translation come back but for rounding.
BalCamera from_state(std::span<const double> state);

/// Whether a point lies behind the camera of that state, which looks along its −z axis.
bool is_behind(std::span<const double> camera_state, std::span<const double> point);

}  // namespace cairn::formats
