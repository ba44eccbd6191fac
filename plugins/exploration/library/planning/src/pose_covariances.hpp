// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Covariances of the poses of a graph, taken from its estimator and moved into one frame.
///
/// The error of pose i is ε_i = Ad(o⁻¹ x_i) δ_i, δ_i on its right tangent and o the origin. There
/// odometry is a random walk, ε_k = ε_{k−1} + η_k, a relative measurement of two poses is
/// ε_k − ε_l + ν, and determinants are those on the tangents. The origin is where the robot is, so
/// that numbers stay small.
///
/// The graph's first pose is fixed; a prior P on it adds the same to every block: it is kept apart,
/// since no relative measurement depends on it.
///
/// Blocks are stored by entry, one number for each pose in a row, as many as are a multiple of
/// `kLanes`; those behind the last pose are zero.
class PoseCovariances {
 public:
  static constexpr int kLanes = 8;

  PoseCovariances(const Situation& situation, const Pose2& origin);

  int size() const { return static_cast<int>(ids_.size()); }
  int padded() const { return padded_; }
  Id id(int pose) const { return ids_[static_cast<std::size_t>(pose)]; }
  const Pose2& pose(int pose) const { return poses_[static_cast<std::size_t>(pose)]; }
  std::span<const Pose2> poses() const { return poses_; }
  const Pose2& origin() const { return origin_; }

  /// Σ_ii without the prior.
  const Eigen::Matrix3d& diagonal(int pose) const {
    return diagonal_[static_cast<std::size_t>(pose)];
  }
  const Eigen::Matrix3d& prior() const { return prior_; }
  /// Of the column of pose a, Σ_ia: entry (r, c) of pose i at [(3 c + r) · padded + i]. It is taken
  /// from the estimator when it is first asked for.
  const double* column(int a);
  Eigen::Matrix3d block(int i, int a);

  /// Turns a covariance on the right tangent at `at` into the frame, and back.
  Eigen::Matrix3d moved(const Pose2& at, const Eigen::Matrix3d& covariance) const;
  Eigen::Matrix3d moved_back(const Pose2& at, const Eigen::Matrix3d& covariance) const;

 private:
  Estimator* estimator_;
  Pose2 origin_;
  std::vector<Id> ids_;
  std::vector<Pose2> poses_;
  std::vector<Eigen::Matrix3d> adjoints_, diagonal_;
  Eigen::Matrix3d prior_;
  int padded_ = 0;
  std::vector<std::vector<double>> columns_;
  std::vector<double> taken_;  ///< a column as the estimator returns it
};

/// The motion from the last pose that is kept to where the robot is: none if it is there.
std::optional<Pose2> motion_since_newest(const Situation& situation);

}  // namespace cairn
