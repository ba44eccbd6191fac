// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

namespace cairn::performance {

struct PlanarPose {
  double x = 0.0, y = 0.0;  ///< [m]
  double theta = 0.0;       ///< [rad]
};

/// a · b.
PlanarPose compose(const PlanarPose& a, const PlanarPose& b);
/// a⁻¹ b.
PlanarPose between(const PlanarPose& a, const PlanarPose& b);

/// Absolute trajectory error, as of `cairn evaluate`: root mean squares of what is left after the
/// rigid motion that brings the positions nearest to the true ones.
struct PlanarError {
  double translation = 0.0;  ///< [m]
  double rotation = 0.0;     ///< [rad]
};
/// Of as many poses as there are true ones; NaN of none.
PlanarError planar_error(std::span<const PlanarPose> estimate, std::span<const PlanarPose> truth);

}  // namespace cairn::performance
