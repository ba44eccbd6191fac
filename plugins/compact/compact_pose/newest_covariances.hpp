// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "kept_poses.hpp"
#include "rigid_group.hpp"

namespace cairn::compact {

/// Covariances of kept poses with the newest, kept or not, at the present estimate: solved for when
/// they are asked for, and good until the estimate changes.
///
/// Odometry alone leads to the newest pose n from the anchor a, a pose that the estimator has;
/// other poses beyond the anchor are on this chain. With μ the composed relative pose from there
/// and A = Ad(μ⁻¹),
///
///     x_n = x_a μ,  Σ_in = Σ_ia Aᵀ,  Σ_nn = A Σ_aa Aᵀ + Σ_μ,
///
/// just as the estimator would have them.
class NewestCovariances {
 public:
  /// Rises whenever the estimate and its covariances change.
  int version() const { return version_; }
  void estimate_changed();
  /// The newest pose is that by odometry from the anchor, `ahead`; empty: it is the anchor.
  void advance(Ahead ahead);
  void set_anchor(int anchor, Ahead ahead);
  const Ahead& ahead() const { return ahead_; }

  /// Solves for what `set_covariance` takes of these poses.
  void prepare(std::span<const int> poses, const KeptPoses& kept);
  bool prepared(int pose, const KeptPoses& kept) const;
  /// Of the displacement from a pose, which was prepared, to the newest. `odometry`: from
  /// `predecessor`, the last kept pose before it.
  void set_covariance(int pose, int predecessor, const Motion& odometry, const KeptPoses& kept,
                      Displacement& displacement) const;
  /// Σ_nn
  const Matrix& newest(const KeptPoses& kept);
  /// Joint covariance of variables that the estimator has and, after them, the newest pose.
  /// `sizes`: of their tangent spaces.
  Eigen::MatrixXd joint(std::vector<Id> ids, std::span<const int> sizes, const KeptPoses& kept);

 private:
  struct OfPose {
    int version = -1;
    Matrix own{}, cross{};  ///< Σ_ii; Σ_ia
  };

  /// Whether a pose is connected to the anchor by odometry alone, or is the anchor.
  bool on_chain(int pose, const KeptPoses& kept) const {
    return pose == anchor_ || pose >= kept.solved();
  }
  void know_anchor(const KeptPoses& kept);
  void know_newest(const RigidGroup& group);

  int version_ = 0;
  int anchor_ = -1;
  Ahead ahead_;  ///< of the newest
  std::vector<OfPose> poses_;
  int anchored_version_ = -1;
  Matrix S_aa_;         ///< of that version
  bool known_ = false;  ///< A_ and S_nn_ are those of the newest pose
  Matrix A_, S_nn_;
};

}  // namespace cairn::compact
