// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

#include "cairn/exploration/exploration.hpp"
#include "scan_poses.hpp"

namespace cairn {

double trajectory_entropy(Estimator& estimator, std::span<const Id> poses,
                          const Eigen::Vector3d& first_sigma) {
  if (poses.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double constant = 1.5 * std::log(2.0 * std::numbers::pi * std::numbers::e);
  const Pose2 first = pose_in(estimator, poses.front());
  const Eigen::Matrix3d prior = first_sigma.array().square().matrix().asDiagonal();
  double sum = 0.0;
  for (const Id id : poses) {
    std::array<double, 9> block{};
    if (!estimator.covariance(id, id, block)) return std::numeric_limits<double>::quiet_NaN();
    // The prior's error moves all poses as a whole, independently of what was measured.
    const Eigen::Matrix3d moved = pose_in(estimator, id).between(first).adjoint();
    const Eigen::Matrix3d covariance =
        Eigen::Map<const Eigen::Matrix3d>(block.data()) + moved * prior * moved.transpose();
    sum += constant + std::log(covariance.determinant());
  }
  return sum / static_cast<double>(poses.size());
}

}  // namespace cairn
