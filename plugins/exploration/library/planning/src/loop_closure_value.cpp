// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/loop_closure_value.hpp"

#include <array>
#include <cmath>
#include <span>

#include "cairn/information/gaussian.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;

Pose2 pose_of(Estimator& estimator, Id id) {
  return Pose2(Eigen::Map<const Eigen::Vector3d>(estimator.state(id).data()));
}

/// From the tangent (forward, left, turn) of a pose to world coordinates, or the inverse.
Matrix3d turned(double angle) {
  Matrix3d R = Matrix3d::Identity();
  R(0, 0) = R(1, 1) = std::cos(angle);
  R(1, 0) = std::sin(angle);
  R(0, 1) = -R(1, 0);
  return R;
}

}  // namespace

double loop_closure_change(const Pose2& earlier, const Matrix3d& ii, const Matrix3d& it,
                           const Matrix3d& tt, const Matrix3d& noise, EntropyForm form) {
  const Matrix3d R = turned(-earlier.theta());
  const Matrix3d apart = R * (ii + tt - it - it.transpose()) * R.transpose();
  return (form == EntropyForm::standard ? -1.0 : -2.0) * information_gain(apart, noise);
}

std::vector<LoopClosureValue> loop_closure_values(const Situation& situation, EntropyForm form) {
  if (situation.poses.empty()) return {};
  Estimator& estimator = situation.estimator;
  const Id newest = situation.poses.back();
  const auto count = static_cast<Eigen::Index>(situation.poses.size());
  Eigen::MatrixXd column(3 * count, 3);
  const std::span out(column.data(), static_cast<std::size_t>(column.size()));
  if (!estimator.covariance_column(newest, situation.poses, out)) return {};
  const Matrix3d R_t = turned(pose_of(estimator, newest).theta());
  const Matrix3d tt = R_t * column.bottomRows<3>() * R_t.transpose();
  const Matrix3d noise = situation.match.covariance();
  std::vector<LoopClosureValue> values;
  for (Eigen::Index k = 0; k + 1 < count; ++k) {
    const Id id = situation.poses[static_cast<std::size_t>(k)];
    const Pose2 pose = pose_of(estimator, id);
    if (can_match(pose, situation.pose, situation.match)) continue;
    Matrix3d block;
    if (!estimator.covariance(id, id, {block.data(), 9})) return {};
    const Matrix3d R_i = turned(pose.theta());
    const Matrix3d ii = R_i * block * R_i.transpose();
    const Matrix3d it = R_i * column.middleRows<3>(3 * k) * R_t.transpose();
    values.push_back({id, pose, loop_closure_change(pose, ii, it, tt, noise, form)});
  }
  return values;
}

bool can_match(const Pose2& older, const Pose2& newer, const MatchModel& match) {
  const Pose2 apart = older.between(newer);
  return std::abs(apart.x()) <= match.range && std::abs(apart.y()) <= match.range &&
         std::abs(apart.theta()) <= match.angle;
}

std::optional<Matrix3d> newest_covariance(const Situation& situation) {
  if (situation.poses.empty()) return std::nullopt;
  Estimator& estimator = situation.estimator;
  const Id newest = situation.poses.back(), first = situation.poses.front();
  Matrix3d block;
  if (!estimator.covariance(newest, newest, {block.data(), 9})) return std::nullopt;
  const Matrix3d prior = situation.first_sigma.array().square().matrix().asDiagonal();
  // The prior's error moves all poses as a whole, independently of what was measured.
  const Matrix3d moved = pose_of(estimator, newest).between(pose_of(estimator, first)).adjoint();
  return block + moved * prior * moved.transpose();
}

}  // namespace cairn
