// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace cairn::performance {

/// What a camera measures of pairs of its poses, all with the same noise.
struct CameraSensor {
  double translation_sigma = 0.017;  ///< each axis [m]
  double rotation_sigma = 0.0012;    ///< each axis [rad]
  double range = 25.0;               ///< of loop closures [m]
  double angle = 1.1;                ///< between the directions of view [rad]
  double matched = 0.05;             ///< share of the pairs within these that are matched
  std::uint64_t seed = 1;
};

/// Graphs as g2o text, for the metric rotation_vector.
struct CameraWorld {
  std::string truth;         ///< the poses
  std::string measurements;  ///< odometry and loop closures
};

/// Simulated measurements along KITTI's poses of a camera, rows of [R t]: from each pose to the
/// next, and of all pairs within the sensor's reach. Poses keep the camera's axes: x to the right,
/// y down and z forward.
CameraWorld camera_world(const std::string& kitti, const CameraSensor& sensor);

}  // namespace cairn::performance
