// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "marginal_kernels.hpp"
#include "pose_covariances.hpp"

namespace cairn {

/// The marginals of poses of the graph after a loop closure on a path, stored as the columns of
/// `PoseCovariances` are.
struct UpdatedMarginals {
  /// Z_i = L⁻¹ cov(y, ε_i) of this closure, by which Σ_ii has become less: Σ'_ii = Σ_ii − Z_iᵀ Z_i.
  /// Entry (r, c) of pose i at [(3 c + r) · padded + i].
  std::vector<double> Z;
  /// Σ'_ii with the prior after all closures so far, its lower triangle by columns.
  std::vector<double> diagonal;
};

/// What a path's loop closures do to the poses of the graph, as far as it has been computed.
struct ClosureEffect {
  /// As long as they are kept.
  mutable std::weak_ptr<const UpdatedMarginals> marginals;
  /// Σ ln(|Σ'_ii| / |Σ_ii|) of the graph's poses after this closure and those before it.
  mutable std::optional<double> change;
};

/// What a path knows of how a pose l of the graph and its own end k are related, after its closures
/// so far: with Σ_kk as it was before all of them, cov(ε_k − ε_l) = Σ_kk + apart and
/// cov(ε_k, ε_k − ε_l) = Σ_kk − cross. Neither depends on k, since odometry's noise is independent.
struct PoseTerms {
  Eigen::Matrix3d apart, cross;
};

/// A loop closure on a path: the measurement y = ε_k − ε_l + ν of a pose k of the path and l of the
/// graph. The closures of a path are a list from the last one back. Their innovations are whitened
/// one after another: with S = L Lᵀ the joint covariance of all y, Z = L⁻¹ cov(y, ·) of any pose
/// has the posterior covariance cov(a, b) − Z_aᵀ Z_b.
struct PathClosure {
  std::shared_ptr<const PathClosure> before;
  int count = 1;       ///< with those before
  int pose = 0;        ///< l, of the graph
  int step = 0;        ///< k, of the path
  double ratio = 1.0;  ///< |Σ'_kk| / |Σ_kk|
  /// The row of L: a block for each closure before, and the inverse of the one on the diagonal.
  std::vector<Eigen::Matrix3d> coupling;
  Eigen::Matrix3d inverse;
  /// Z of all poses of the path from k on.
  Eigen::Matrix3d end;
  /// Of ε_k, without the prior: what odometry has added since the graph, and after this closure.
  Eigen::Matrix3d walk, posterior;
  /// Of each stretch of the path before k, which begin at its start and where it closes loops: Z
  /// of its first pose and Z₁ of noise on the stretch (see `StretchUpdate`), and after all closures
  /// so far Σ' of its first pose, Q and T. A pose of the stretch to which odometry has come with
  /// the noise D has Σ'_jj = Σ' + D − D Q − Qᵀ D − D T D. So a further closure takes time as there
  /// are closures, and not as there are poses.
  std::vector<double> stretch_Z, stretch_marginals;
  /// Σ ln|Σ'_jj| of the poses 1 … k of the path, with the prior, once it has been asked for.
  mutable std::optional<double> path_sum;
  /// Z and terms of those poses of the graph for which they have been needed.
  struct OfPose {
    Eigen::Matrix3d Z;
    PoseTerms terms;
  };
  mutable std::unordered_map<int, OfPose> of_poses;
  /// On all poses of the graph, and estimated by a few of them.
  ClosureEffect exact, estimate;
};

/// The closures of a path in their order.
std::vector<const PathClosure*> in_order(const PathClosure* last);

/// What a new closure, of which all but these is known, does to the stretches of the path.
/// `innovation`: cov(y, ε_t) of the pose of the graph from which the path goes on, `start` the
/// noise and `start_posterior` the covariance of ε at its start.
void update_stretches(std::span<const PathClosure* const> before, const Eigen::Matrix3d& innovation,
                      const Eigen::Matrix3d& start, const Eigen::Matrix3d& start_posterior,
                      PathClosure& closure);

/// Of a stretch of a path.
struct StretchMarginals {
  Eigen::Matrix3d posterior, Q, T;
  StretchMarginals(const PathClosure& closure, int stretch);
  /// Σ'_jj of the pose to which odometry has come with the noise D.
  Eigen::Matrix3d after(const Eigen::Matrix3d& D) const;
};

/// The marginals of the graph's poses after the closures of a path, of all of them or of a few by
/// which the others are estimated: marginals change smoothly along a trajectory.
class MarginalUpdates {
 public:
  /// The effect of a closure on all poses, for which `memory` is kept [bytes].
  MarginalUpdates(PoseCovariances& covariances, double memory)
      : MarginalUpdates(covariances, memory, covariances.size(), &PathClosure::exact) {}
  /// The estimate by at most `most_poses` (1 or more) of them: each stands for a part of the
  /// trajectory, of the same length but for the last one, in the middle of which it is.
  MarginalUpdates(PoseCovariances& covariances, double memory, int most_poses)
      : MarginalUpdates(covariances, memory, most_poses, &PathClosure::estimate) {}

  /// Whether it is of all poses.
  bool is_of_all() const { return every_ == 1; }
  /// Σ ln|Σ_ii| now, with the prior, of its poses.
  double sum() const { return sum_; }
  /// `ClosureEffect::change`. The loops that a path has closed since it was asked for last are
  /// worked off together, in one pass over the poses.
  double change(const PathClosure& closure);

 private:
  MarginalUpdates(PoseCovariances& covariances, double memory, int most_poses,
                  ClosureEffect PathClosure::*effect);
  /// The number in the graph of its pose i: the middle one of those for which it stands.
  int pose(std::size_t i) const {
    const int begin = every_ * static_cast<int>(i);
    return begin + (i + 1 < count_ ? every_ : last_weight_) / 2;
  }
  /// Σ_ia of its poses.
  const double* column(int a);
  /// Computes the marginals after the last of the closures, with those before that are not kept,
  /// and its change.
  void update(std::span<const PathClosure* const> closures);
  std::shared_ptr<UpdatedMarginals> unused();

  PoseCovariances& covariances_;
  ClosureEffect PathClosure::*effect_;
  UpdateMarginals kernel_;
  int every_;                                            ///< poses for which one stands
  std::size_t count_, padded_;                           ///< its poses
  int last_weight_;                                      ///< poses for which the last one stands
  std::vector<std::vector<double>> columns_;             ///< of its poses, where it has not all
  std::vector<double> diagonal_, inverse_determinants_;  ///< with the prior, now
  std::vector<double> ratios_;
  double sum_ = 0.0;
  std::size_t most_kept_ = 0;
  std::deque<std::shared_ptr<UpdatedMarginals>> kept_;  ///< oldest first
};

}  // namespace cairn
