// SPDX-License-Identifier: BSD-3-Clause
#include "pose_covariances.hpp"

#include <cstddef>

#include <Eigen/LU>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;

[[noreturn]] void fail_singular() {
  throw Error(ErrorCode::numerical,
              "the pose graph has no covariances: its information matrix is singular");
}

}  // namespace

PoseCovariances::PoseCovariances(const Situation& situation, const Pose2& origin)
    : estimator_(&situation.estimator),
      origin_(origin),
      ids_(situation.poses.begin(), situation.poses.end()),
      columns_(situation.poses.size()) {
  if (ids_.empty()) throw Error(ErrorCode::usage, "the information of paths needs a pose graph");
  const std::size_t n = ids_.size();
  padded_ = static_cast<int>((n + kLanes - 1) / kLanes * kLanes);
  for (const Id id : ids_) {
    poses_.push_back(Pose2::from_state(estimator_->state(id)));
    adjoints_.push_back(origin_.between(poses_.back()).adjoint());
    Matrix3d block;
    if (!estimator_->covariance(id, id, {block.data(), 9})) fail_singular();
    diagonal_.emplace_back(adjoints_.back() * block * adjoints_.back().transpose());
  }
  const Matrix3d first = situation.first_sigma.array().square().matrix().asDiagonal();
  prior_ = moved(poses_.front(), first);
}

const double* PoseCovariances::column(int a) {
  const std::size_t n = ids_.size();
  std::vector<double>& column = columns_[static_cast<std::size_t>(a)];
  if (!column.empty()) return column.data();
  taken_.resize(9 * n);
  if (!estimator_->covariance_column(id(a), ids_, taken_)) fail_singular();
  const std::size_t padded = static_cast<std::size_t>(padded_);
  column.assign(9 * padded, 0.0);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>> blocks(
      taken_.data(), static_cast<Eigen::Index>(3 * n), 3);
  const Matrix3d right = adjoints_[static_cast<std::size_t>(a)].transpose();
  for (std::size_t i = 0; i < n; ++i) {
    const Matrix3d block =
        adjoints_[i] * blocks.middleRows<3>(static_cast<Eigen::Index>(3 * i)) * right;
    for (std::size_t entry = 0; entry < 9; ++entry)
      column[entry * padded + i] = block.data()[entry];
  }
  return column.data();
}

Matrix3d PoseCovariances::block(int i, int a) {
  const double* entries = column(a);
  Matrix3d block;
  for (int entry = 0; entry < 9; ++entry)
    block.data()[entry] = entries[static_cast<std::ptrdiff_t>(entry) * padded_ + i];
  return block;
}

Matrix3d PoseCovariances::moved(const Pose2& at, const Matrix3d& covariance) const {
  const Matrix3d Ad = origin_.between(at).adjoint();
  return Ad * covariance * Ad.transpose();
}

Matrix3d PoseCovariances::moved_back(const Pose2& at, const Matrix3d& covariance) const {
  const Matrix3d Ad = at.between(origin_).adjoint();
  return Ad * covariance * Ad.transpose();
}

std::optional<Pose2> motion_since_newest(const Situation& situation) {
  const Pose2 newest = Pose2::from_state(situation.estimator.state(situation.poses.back()));
  const Pose2 motion = newest.between(situation.pose);
  constexpr double kRounding = 1e-9;
  if (motion.state().cwiseAbs().maxCoeff() > kRounding) return motion;
  return std::nullopt;
}

}  // namespace cairn
