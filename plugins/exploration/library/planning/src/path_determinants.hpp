// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "marginal_kernels.hpp"
#include "match_index.hpp"
#include "pose_covariances.hpp"

namespace cairn {

/// What a path adds to ln |Λ| of a pose graph, for many paths from one place.
///
/// A path adds what `PathInformation` adds, but all of its motions are known beforehand, and so are
/// the poses of the graph that some of its own could close a loop with, the *partners*. With
/// y = ε_k − ε_l + ν the innovation of a loop closure that is made and L Lᵀ the joint covariance of
/// all of them, D_l = L⁻¹ cov(y, ε_k − ε_l) is the same for all later poses k of the path. So each
/// closure adds a block to D of all partners that are still ahead, in one pass over contiguous
/// numbers, and their
///
///     S_l = cov(ε_k − ε_l) − D_lᵀ D_l,    K_l = cov(ε_k, ε_k − ε_l) − Z_kᵀ D_l,
///
/// Z_k = L⁻¹ cov(y, ε_k), are at hand when pose k asks which partner is best. A path with c
/// closures and m partners costs c² m / 2 products of 3×3 matrices.
class PathDeterminants {
 public:
  /// Whether a pose at `newer` can be matched with one at `older`, besides being in its match area.
  using CanMatch = std::function<bool(const Pose2& older, const Pose2& newer)>;

  /// What `situation` refers to must outlive this object. Throws as `PathInformation` does.
  PathDeterminants(const Situation& situation, double loop_gain, CanMatch can_match);

  struct Path {
    double log_determinant = 0.0;  ///< change of ln |Λ|
    int loops = 0;                 ///< closed
    double length = 0.0;           ///< [m]
  };
  /// Of these motions from where the robot is, each in the frame of the pose before.
  Path along(std::span<const Pose2> motions);

 private:
  /// A pose of the path.
  struct Step {
    Pose2 pose;
    Eigen::Matrix3d walk;        ///< of ε_k − ε_t, by odometry alone
    Eigen::Matrix3d noise;       ///< of the last motion
    int first = 0, count = 0;    ///< its partners in `matches_`
    int partners_from_here = 0;  ///< of this pose and those behind it: the first so many
  };
  /// The loop that a pose closes.
  struct Choice {
    int partner = -1;
    double determinant = 0.0;  ///< |S|
    Eigen::Matrix3d S, K;
  };

  void walk(std::span<const Pose2> motions, Path& path);
  void find_partners();
  Choice best_choice(const Step& step, const Eigen::Matrix3d& posterior) const;
  void close(const Choice& choice, const Step& step, int partners_ahead,
             Eigen::Matrix3d& posterior);
  Eigen::Matrix3d block(const std::vector<double>& entries, int partner) const;

  PoseCovariances covariances_;
  CanMatch can_match_;
  MatchModel match_;
  OdometryModel odometry_;
  MatchIndex index_;
  UpdatePartners update_;
  Eigen::Matrix3d newest_;    ///< Σ_tt
  Eigen::Matrix3d to_robot_;  ///< of ε_robot − ε_t
  Pose2 robot_;
  double log_match_, least_determinant_;  ///< ln |R|; |S| that gains as much as a closure must

  // Of the path at hand.
  std::vector<Step> steps_;
  std::vector<int> matches_;     ///< poses of the graph, then partners
  std::vector<int> partner_of_;  ///< by pose of the graph; −1: none
  std::vector<int> pose_of_;     ///< by partner
  int stride_ = 0;               ///< numbers per entry of a block: one for each partner, padded
  std::vector<double> cross_;    ///< Σ_tl, by entry (r, c) of partner p at [(3 c + r) stride_ + p]
  std::vector<double> S_, K_;    ///< likewise, without walk and R; of S the lower triangle
  std::vector<double> D_;        ///< of all closures so far
  std::vector<double> innovation_, coupling_;
  int closures_ = 0;
};

}  // namespace cairn
