// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace cairn {

/// How much larger the errors of odometry are than its model says, learnt from matches of scans.
class OdometryScale {
 public:
  /// The covariance of a motion, each component scaled by what has been learnt.
  Eigen::Matrix3d scaled(const Eigen::Matrix3d& covariance) const;
  /// Learns from a match: `apart` is the difference of match and odometry [m, m, rad], `covariance`
  /// that of odometry by its model, `noise` that of the match. Components that the match hardly
  /// measures are left out.
  void learn(const Eigen::Vector3d& apart, const Eigen::Matrix3d& covariance,
             const Eigen::Matrix3d& noise);

 private:
  /// By component and in order, the factor of the model's variance with which nine tenths of
  /// differences like each of these would be smaller.
  std::array<std::vector<double>, 3> ratios_;
};

}  // namespace cairn
