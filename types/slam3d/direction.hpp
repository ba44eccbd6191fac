// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam3d {

/// A direction that is known in the world, such as that of gravity or of the magnetic field, seen
/// from a pose: z = (d, m), both unit vectors, d in the world and m in the frame of the pose.
/// error = Rᵀ d − m, for small angles the angle between the two [rad]. The turn about d is not
/// measured and changes nothing, however large it is.
struct Direction {
  static constexpr std::string_view kTag = "EDGE_SE3_PRIORVEC";
  static constexpr int kResidual = 3, kMeasurement = 6;
  using Variables = std::tuple<Se3>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 7>& x, const Measured<S, 6>& z) noexcept {
    const Vector<S, 3> known{S(z[0]), S(z[1]), S(z[2])};
    const Vector<S, 3> seen = so3::rotate_back<S>(Se3::quaternion<S>(x), known);
    return {seen[0] - z[3], seen[1] - z[4], seen[2] - z[5]};
  }
  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 7>& x, const Vector<S, 6>& z,
                               Eigen::Matrix<S, 3, 6>& J) noexcept {
    const Vector<S, 3> known(z[0], z[1], z[2]);
    const Vector<S, 3> seen = so3::rotate_back<S>(Se3::quaternion<S>(x), known);
    const so3::Matrix3<S> turning = so3::hat<S>(seen);
    for (int k = 0; k < 9; ++k) {
      J.data()[k] = 0.0;
      J.data()[9 + k] = turning.data()[k];
    }
    return {seen[0] - z[3], seen[1] - z[4], seen[2] - z[5]};
  }

  static std::string normalize(Vector<double, 6>& z) {
    if (!z.allFinite()) return "a number is not finite";
    for (int first : {0, 3}) {
      const double length = z.segment<3>(first).stableNorm();
      if (length < 1e-9) {
        return first == 0 ? "the direction in the world is zero"
                          : "the direction in the frame of the pose is zero";
      }
      // Some last bits off is as good as dividing again gets it, as with quaternions.
      if (std::abs(length - 1.0) > 1e-15) z.segment<3>(first) /= length;
    }
    return {};
  }
};

}  // namespace cairn::slam3d
