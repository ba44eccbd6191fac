// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/point.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam2d {

/// Landmark b as it lies from landmark a, z = (x y [m]) along the axes of the world: error = (b −
/// a) − z. A translation of both changes nothing; a rotation does.
struct RelativePoint {
  static constexpr std::string_view kTag = "EDGE_POINTXY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  static constexpr int kAbsolute = 1;  // degrees of freedom of orientation: those of a direction
  using Variables = std::tuple<PointXY, PointXY>;

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Measured<S, 2>& z) noexcept {
    return {b[0] - a[0] - z[0], b[1] - a[1] - z[1]};
  }

  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 2>& a, const Vector<S, 2>& b, const Vector<S, 2>& z,
                               Eigen::Matrix<S, 2, 2>& J_a, Eigen::Matrix<S, 2, 2>& J_b) noexcept {
    for (int k = 0; k < 4; ++k) {
      J_a.data()[k] = k % 3 == 0 ? -1.0 : 0.0;
      J_b.data()[k] = k % 3 == 0 ? 1.0 : 0.0;
    }
    return b - a - z;
  }

  static std::string normalize(Vector<double, 2>& z) { return PointXY::normalize(z); }

  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    const double* other = x[1 - target];
    for (int k = 0; k < 2; ++k) out[k] = target == 1 ? other[k] + z[k] : other[k] - z[k];
    return true;
  }
};

}  // namespace cairn::slam2d
