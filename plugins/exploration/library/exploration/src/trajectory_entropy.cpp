// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

#include "cairn/exploration/exploration.hpp"
#include "pose_covariance.hpp"
#include "scan_poses.hpp"

namespace cairn {

std::optional<Eigen::Matrix3d> covariance_with_prior(Estimator& estimator, Id id,
                                                     const Pose2& first,
                                                     const Eigen::Vector3d& first_sigma) {
  std::array<double, 9> block{};
  if (!estimator.covariance(id, id, block)) return std::nullopt;
  const Eigen::Matrix3d prior = first_sigma.array().square().matrix().asDiagonal();
  // The prior's error moves all poses as a whole, independently of what was measured.
  const Eigen::Matrix3d moved = pose_in(estimator, id).between(first).adjoint();
  return Eigen::Map<const Eigen::Matrix3d>(block.data()) + moved * prior * moved.transpose();
}

double trajectory_entropy(Estimator& estimator, std::span<const Id> poses,
                          const Eigen::Vector3d& first_sigma) {
  if (poses.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double constant = 1.5 * std::log(2.0 * std::numbers::pi * std::numbers::e);
  const Pose2 first = pose_in(estimator, poses.front());
  double sum = 0.0;
  for (const Id id : poses) {
    const auto covariance = covariance_with_prior(estimator, id, first, first_sigma);
    if (!covariance) return std::numeric_limits<double>::quiet_NaN();
    sum += constant + std::log(covariance->determinant());
  }
  return sum / static_cast<double>(poses.size());
}

}  // namespace cairn
