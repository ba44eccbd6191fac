// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>

#include <Eigen/Core>

namespace cairn::formats {

/// Where a sensor sits on the robot (g2o's PARAMS_SE3OFFSET): p_robot = R p_sensor + t.
struct SensorOffset {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  bool is_identity = true;

  /// From x y z qx qy qz qw. Returns an empty string, or what is wrong with the numbers.
  std::string set(std::span<const double, 7> numbers);

  /// Turns a point seen in the sensor's frame into the same point in the robot's frame: z' = R z +
  /// t, and its information Ω' = R Ω Rᵀ, since e' = R e. Exact; an identity offset changes no bit.
  void apply_to_point(std::span<double, 3> measurement, std::span<double, 6> information) const;
};

}  // namespace cairn::formats
