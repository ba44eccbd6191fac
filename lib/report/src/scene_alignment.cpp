// SPDX-License-Identifier: BSD-3-Clause
#include "scene_alignment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/graph/packed.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The numbers of one variable's orientation: an angle, or a quaternion x y z w.
std::size_t orientation_size(const Scene& scene) { return scene.dimension == 2 ? 1 : 4; }

Vector3d point(const double* numbers, int dimension) {
  return {numbers[0], numbers[1], dimension == 3 ? numbers[2] : 0.0};
}

Matrix3d rotation(const float* numbers, int dimension) {
  if (dimension == 2) return Eigen::AngleAxisd(numbers[0], Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Quaterniond q(numbers[3], numbers[0], numbers[1], numbers[2]);
  return q.normalized().toRotationMatrix();
}

/// The poses that are placed, by their index in the scene.
Trajectory poses_of(const SceneEstimate& estimate, const Scene& scene) {
  const auto d = static_cast<std::size_t>(scene.dimension), o = orientation_size(scene);
  Trajectory poses;
  for (std::size_t v = 0; v < scene.ids.size(); ++v) {
    if (!scene.variable_types[scene.variable_type[v]].pose) continue;
    const Vector3d t = point(&estimate.positions[d * v], scene.dimension);
    if (estimate.orientation.empty() || !t.allFinite() ||
        !std::isfinite(estimate.orientation[o * v])) {
      continue;
    }
    const Matrix3d R = rotation(&estimate.orientation[o * v], scene.dimension);
    TrajectoryPose& pose = poses.emplace_back();
    pose.id = static_cast<Id>(v);
    std::ranges::copy(t, pose.t.begin());
    std::copy_n(R.data(), R.size(), pose.R.begin());
  }
  return poses;
}

/// Σ of a position after the rotation: R Σ Rᵀ.
void turn_covariance(float* upper, const Matrix3d& R, int dimension) {
  std::array<double, 6> packed{};
  std::copy_n(upper, packed_size(dimension), packed.begin());
  Eigen::MatrixXd S(dimension, dimension);
  unpack(packed.data(), S);
  const Eigen::MatrixXd turn = R.topLeftCorner(dimension, dimension);
  pack(Eigen::MatrixXd(turn * S * turn.transpose()), packed.data());
  std::transform(packed.begin(), packed.begin() + std::ptrdiff_t(packed_size(dimension)), upper,
                 [](double number) { return static_cast<float>(number); });
}

}  // namespace

std::optional<Pose> motion_to(const SceneEstimate& truth, const SceneEstimate& estimate,
                              const Scene& scene) {
  const Trajectory of_truth = poses_of(truth, scene);
  TrajectoryPairs pairs;
  auto other = of_truth.begin();
  for (const TrajectoryPose& pose : poses_of(estimate, scene)) {
    while (other != of_truth.end() && other->id < pose.id) ++other;
    if (other == of_truth.end() || other->id != pose.id) continue;
    pairs.estimate.push_back(pose);
    pairs.truth.push_back(*other);
  }
  if (pairs.estimate.size() < 2) return std::nullopt;
  return align(pairs);
}

void move(SceneEstimate& estimate, const Scene& scene, const Pose& motion) {
  const auto d = static_cast<std::size_t>(scene.dimension), o = orientation_size(scene);
  for (std::size_t v = 0; v < scene.ids.size(); ++v) {
    const Vector3d p = motion.R * point(&estimate.positions[d * v], scene.dimension) + motion.t;
    std::copy_n(p.data(), d, &estimate.positions[d * v]);
    if (estimate.orientation.empty() || !std::isfinite(estimate.orientation[o * v])) continue;
    const Matrix3d R = motion.R * rotation(&estimate.orientation[o * v], scene.dimension);
    if (scene.dimension == 2) {
      estimate.orientation[v] = static_cast<float>(std::atan2(R(1, 0), R(0, 0)));
    } else {
      const Eigen::Vector4f xyzw = Eigen::Quaterniond(R).coeffs().cast<float>();
      std::copy_n(xyzw.data(), o, &estimate.orientation[o * v]);
    }
  }
  const std::size_t packed = packed_size(scene.dimension);
  for (std::size_t k = 0; k < estimate.covariance_variables.size(); ++k)
    turn_covariance(&estimate.covariance_upper[packed * k], motion.R, scene.dimension);
}

void move(Recording& recording, const Scene& scene, const Pose& motion) {
  const auto d = static_cast<std::size_t>(scene.dimension);
  Vector3d origin(scene.origin[0], scene.origin[1], scene.dimension == 3 ? scene.origin[2] : 0.0);
  for (Frame& frame : recording.frames) {
    for (std::size_t k = 0; k + d <= frame.positions.size(); k += d) {
      Vector3d p = origin;
      for (std::size_t c = 0; c < d; ++c) p[Eigen::Index(c)] += frame.positions[k + c];
      p = motion.R * p + motion.t - origin;
      for (std::size_t c = 0; c < d; ++c)
        frame.positions[k + c] = static_cast<float>(p[Eigen::Index(c)]);
    }
  }
}

}  // namespace cairn
