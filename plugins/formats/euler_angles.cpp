// SPDX-License-Identifier: BSD-3-Clause
#include "euler_angles.hpp"

#include <cmath>

#include <Eigen/Geometry>

namespace cairn::formats {

std::array<double, 4> quaternion_from(std::span<const double, 3> roll_pitch_yaw) {
  const double roll = roll_pitch_yaw[0], pitch = roll_pitch_yaw[1], yaw = roll_pitch_yaw[2];
  const double cr = std::cos(roll / 2), sr = std::sin(roll / 2);
  const double cp = std::cos(pitch / 2), sp = std::sin(pitch / 2);
  const double cy = std::cos(yaw / 2), sy = std::sin(yaw / 2);
  return {sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
          cr * cp * cy + sr * sp * sy};
}

std::array<double, 3> angles_from(std::span<const double, 4> quaternion) {
  const Eigen::Matrix3d R =
      Eigen::Quaterniond(quaternion[3], quaternion[0], quaternion[1], quaternion[2])
          .toRotationMatrix();
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  // What is left, Rz(yaw)ᵀ R = Ry(pitch) Rx(roll), determines the others whatever yaw is.
  const double c = std::cos(yaw), s = std::sin(yaw);
  const double pitch = std::atan2(-R(2, 0), c * R(0, 0) + s * R(1, 0));
  const double roll = std::atan2(s * R(0, 2) - c * R(1, 2), c * R(1, 1) - s * R(0, 1));
  return {roll + 0.0, pitch + 0.0, yaw + 0.0};  // no −0
}

}  // namespace cairn::formats
