// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam3d {

/// Landmark l seen from a pose at z = (x y z [m]) in the frame of the pose: error = Rᵀ (l − t) − z.
struct Landmark {
  static constexpr std::string_view kTag = "EDGE_SE3_TRACKXYZ";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se3, PointXYZ>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 7>& pose, const Vector<S, 3>& landmark,
                               const Measured<S, 3>& z) noexcept {
    const Vector<S, 3> apart = landmark - Se3::translation<S>(pose);
    const Vector<S, 3> seen = so3::rotate_back<S>(Se3::quaternion<S>(pose), apart);
    return {seen[0] - z[0], seen[1] - z[1], seen[2] - z[2]};
  }

  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 7>& pose, const Vector<S, 3>& landmark,
                               const Vector<S, 3>& z, Eigen::Matrix<S, 3, 6>& J_pose,
                               so3::Matrix3<S>& J_landmark) noexcept {
    J_landmark = so3::matrix<S>(Se3::quaternion<S>(pose)).transpose();
    const Vector<S, 3> apart = landmark - Se3::translation<S>(pose);
    const Vector<S, 3> seen = so3::times<S>(J_landmark, apart);
    const so3::Matrix3<S> turning = so3::hat<S>(seen);
    for (int k = 0; k < 9; ++k) {
      J_pose.data()[k] = k % 4 == 0 ? -1.0 : 0.0;
      J_pose.data()[9 + k] = turning.data()[k];
    }
    return seen - z;
  }

  static std::string normalize(Vector<double, 3>& z) { return PointXYZ::normalize(z); }

  /// The landmark follows from the pose; one landmark does not determine a pose.
  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    if (target != 1) return false;
    const Vector<double, 7> pose = Eigen::Map<const Vector<double, 7>>(x[0]);
    const Vector<double, 3> seen = Eigen::Map<const Vector<double, 3>>(z);
    Eigen::Map<Vector<double, 3>>{out} =
        Se3::position(pose) + so3::rotate<double>(Se3::quaternion<double>(pose), seen);
    return true;
  }
};

}  // namespace cairn::slam3d
