// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/point.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam3d {

/// Landmark b as it lies from landmark a, z = (x y z [m]) along the axes of the world: error = (b −
/// a) − z. A translation of both changes nothing; a rotation does.
struct RelativePoint {
  static constexpr std::string_view kTag = "EDGE_POINTXYZ";
  static constexpr int kResidual = 3, kMeasurement = 3;
  static constexpr int kAbsolute = 2;  // degrees of freedom of orientation: those of a direction
  using Variables = std::tuple<PointXYZ, PointXYZ>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Measured<S, 3>& z) noexcept {
    return {b[0] - a[0] - z[0], b[1] - a[1] - z[1], b[2] - a[2] - z[2]};
  }

  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 3>& a, const Vector<S, 3>& b, const Vector<S, 3>& z,
                               Eigen::Matrix<S, 3, 3>& J_a, Eigen::Matrix<S, 3, 3>& J_b) noexcept {
    for (int k = 0; k < 9; ++k) {
      J_a.data()[k] = k % 4 == 0 ? -1.0 : 0.0;
      J_b.data()[k] = k % 4 == 0 ? 1.0 : 0.0;
    }
    return b - a - z;
  }

  static std::string normalize(Vector<double, 3>& z) { return PointXYZ::normalize(z); }

  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    const double* other = x[1 - target];
    for (int k = 0; k < 3; ++k) out[k] = target == 1 ? other[k] + z[k] : other[k] - z[k];
    return true;
  }
};

}  // namespace cairn::slam3d
