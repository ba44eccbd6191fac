// SPDX-License-Identifier: BSD-3-Clause
#include "newest_covariances.hpp"

#include <utility>

namespace cairn::compact {

void NewestCovariances::estimate_changed() {
  ++version_;
  known_ = false;
}

void NewestCovariances::advance(Ahead ahead) {
  ahead_ = std::move(ahead);
  known_ = false;
}

void NewestCovariances::set_anchor(int anchor, Ahead ahead) {
  anchor_ = anchor;
  ahead_ = std::move(ahead);
}

bool NewestCovariances::prepared(int pose, const KeptPoses& kept) const {
  return on_chain(pose, kept) || (static_cast<std::size_t>(pose) < poses_.size() &&
                                  poses_[static_cast<std::size_t>(pose)].version == version_);
}

void NewestCovariances::prepare(std::span<const int> poses, const KeptPoses& kept) {
  const int n = kept.group()->tangent_size();
  std::vector<Id> ids;
  std::vector<int> missing;
  for (const int pose : poses) {
    if (prepared(pose, kept)) continue;
    missing.push_back(pose);
    ids.push_back(kept.id(pose));
  }
  if (!ids.empty()) {
    know_anchor(kept);
    const Id anchor = kept.id(anchor_);
    Eigen::MatrixXd column(std::ssize(ids) * n, n);
    need_covariance(kept.estimator().covariance_column(
                        anchor, ids, {column.data(), static_cast<std::size_t>(column.size())}),
                    anchor);
    poses_.resize(static_cast<std::size_t>(kept.size()));
    for (std::size_t k = 0; k < missing.size(); ++k) {
      const int pose = missing[k];
      poses_[pose] = {.version = version_,
                      .own = kept.covariance(pose, pose),
                      .cross = column.middleRows(static_cast<Eigen::Index>(k) * n, n)};
    }
  }
  if (!known_ && anchored_version_ == version_) know_newest(*kept.group());
}

void NewestCovariances::know_anchor(const KeptPoses& kept) {
  if (anchored_version_ == version_) return;
  known_ = false;
  S_aa_ = kept.covariance(anchor_, anchor_);
  anchored_version_ = version_;  // not where there is no covariance
}

/// A and Σ_nn of the newest pose, from the anchor's Σ_aa.
void NewestCovariances::know_newest(const RigidGroup& group) {
  const int n = group.tangent_size();
  if (ahead_.covariance.size() == 0) {
    A_ = Matrix::Identity(n, n);
    S_nn_ = S_aa_;
  } else {
    A_ = group.adjoint(group.inverse(ahead_.mean));
    S_nn_ = A_ * S_aa_ * A_.transpose() + ahead_.covariance;
  }
  known_ = true;
}

const Matrix& NewestCovariances::newest(const KeptPoses& kept) {
  know_anchor(kept);
  if (!known_) know_newest(*kept.group());
  return S_nn_;
}

void NewestCovariances::set_covariance(int pose, int predecessor, const Motion& odometry,
                                       const KeptPoses& kept, Displacement& d) const {
  const RigidGroup& group = *kept.group();
  if (ahead_.covariance.size() > 0 && pose == predecessor) {
    d.covariance = to_matrix(odometry.covariance, group.tangent_size());
  } else if (!on_chain(pose, kept)) {
    const OfPose& known = poses_[pose];
    group.set_covariance(known.own, known.cross.lazyProduct(A_.transpose()), S_nn_, d);
  } else {
    // Odometry alone is between them: Σ_an = Ad(d⁻¹) Σ_ai Ad(d⁻¹)ᵀ + Σ_d.
    d.covariance = ahead_.covariance;
    if (pose != anchor_)
      d.covariance -= d.adjoint * kept.ahead(pose).covariance * d.adjoint.transpose();
  }
}

/// The newest is Σ_ia Aᵀ away from those that the estimator has. A column of each of these at a
/// time.
Eigen::MatrixXd NewestCovariances::joint(std::vector<Id> ids, std::span<const int> sizes,
                                         const KeptPoses& kept) {
  const Eigen::Index n = kept.group()->tangent_size();
  Eigen::Index last = 0;
  for (const int size : sizes) last += size;
  Eigen::MatrixXd joint(last + n, last + n);
  joint.bottomRightCorner(n, n) = newest(kept);
  ids.push_back(kept.id(anchor_));
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    const Eigen::Index size = sizes[k];
    Eigen::MatrixXd column(last + n, size);
    need_covariance(kept.estimator().covariance_column(
                        ids[k], ids, {column.data(), static_cast<std::size_t>(column.size())}),
                    ids[k]);
    joint.block(0, at, last, size) = column.topRows(last);
    joint.block(last, at, n, size) = A_ * column.bottomRows(n);
    joint.block(at, last, size, n) = joint.block(last, at, n, size).transpose();
    at += size;
  }
  return joint;
}

}  // namespace cairn::compact
