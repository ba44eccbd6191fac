// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose.hpp"

#include <array>
#include <cmath>
#include <limits>

namespace cairn {

Pose pose_of(const Placement& placement, const double* x) {
  if (placement.dimension() == 3) {
    Pose pose;
    placement.split(x, pose.R.data(), pose.t.data());
    return pose;
  }
  Eigen::Matrix2d R = Eigen::Matrix2d::Identity();
  Eigen::Vector2d t;
  placement.split(x, R.data(), t.data());
  Pose pose;
  pose.R.topLeftCorner<2, 2>() = R;
  pose.t.head<2>() = t;
  return pose;
}

Eigen::Vector3d position(const VariableType& type, std::span<const double> x) {
  const Placement* placement = type.placement();
  if (!placement) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::array<double, 9> R;
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  placement->split(x.data(), R.data(), t.data());
  return t;
}

/// ½(R − Rᵀ) has sin θ times the axis in its strict lower triangle, and tr R = 1 + 2 cos θ.
double rotation_angle(const Eigen::Matrix3d& R) {
  double square = 0.0;
  for (int column = 0; column < 3; ++column) {
    for (int row = column + 1; row < 3; ++row) {
      const double half = 0.5 * (R(row, column) - R(column, row));
      square += half * half;
    }
  }
  return std::atan2(std::sqrt(square), 0.5 * (R(0, 0) + R(1, 1) + (R(2, 2) - 1.0)));
}

}  // namespace cairn
