// SPDX-License-Identifier: BSD-3-Clause
#include "sensor_offset.hpp"

#include <Eigen/Geometry>

#include "cairn/graph/packed.hpp"

namespace cairn::formats {

std::string SensorOffset::set(std::span<const double, 7> numbers) {
  const Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
  const double norm = q.coeffs().stableNorm();
  if (!(norm > 1e-9)) return "the quaternion is zero; expected a rotation";
  t = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  is_identity = t.isZero(0.0) && q.vec().isZero(0.0);
  R = is_identity ? Eigen::Matrix3d::Identity()
                  : Eigen::Quaterniond(q.coeffs() / norm).toRotationMatrix();
  return {};
}

void SensorOffset::apply_to_point(std::span<double, 3> measurement,
                                  std::span<double, 6> information) const {
  if (is_identity) return;
  Eigen::Map<Eigen::Vector3d> z(measurement.data());
  z = (R * z + t).eval();
  const Eigen::Matrix3d omega = unpack<3>(information.data());
  const Eigen::Matrix3d turned = R * omega * R.transpose();
  pack(turned, information.data());
}

}  // namespace cairn::formats
