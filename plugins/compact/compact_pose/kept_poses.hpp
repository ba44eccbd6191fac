// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/solve/estimator.hpp"
#include "pose_index.hpp"
#include "rigid_group.hpp"

namespace cairn::compact {

/// Throws `Error` (numerical) where an estimator has no covariance of a variable.
void need_covariance(bool there, Id id);

/// A motion by odometry alone, with its covariance; without one: there is none.
struct Ahead {
  State mean{};
  Matrix covariance{};
};

/// First one, then the other, to first order, as the estimator's H has it.
Ahead compose(const RigidGroup& group, const Ahead& ahead, const Motion& motion);

/// The poses of a compact graph that are kept, numbered in the order of arrival (anew when poses
/// leave), and the estimator that has them. Those that odometry alone has added are coming: they
/// are passed to it together with the next update.
class KeptPoses {
 public:
  /// A pose that the estimator does not have yet.
  struct Coming {
    Variable variable;
    Factor odometry;
    Ahead ahead{};  ///< from the pose at which the chain of these starts
  };

  explicit KeptPoses(std::unique_ptr<Estimator> estimator) : estimator_(std::move(estimator)) {}

  /// What all of them are; null before the first.
  const RigidGroup* group() const { return group_.get(); }
  void set_group(std::unique_ptr<RigidGroup> group);

  int size() const { return static_cast<int>(kept_.size()); }
  Id id(int pose) const { return kept_[pose].id; }
  const PlacedState& placed(int pose) const { return kept_[pose].placed; }
  const State& state(int pose) const { return kept_[pose].placed.x; }
  std::vector<Id> ids() const;
  /// The number of a pose; -1: it is not there.
  int find(Id id) const;
  /// Within a distance [m] of a place, by rising number.
  std::vector<int> near(const Eigen::Vector3d& at, double radius) const {
    return index_->near(at, radius);
  }

  /// A pose that the estimator has already.
  void add(Id id);
  void add(Coming pose, const PlacedState& placed);
  /// Poses have left the estimator, which has all others: pose k has the number `now[k]` now, −1 if
  /// it has left.
  void renumber(std::span<const int> now);
  /// Reads the estimate, which has changed.
  void read_states();

  /// So many of them has the estimator.
  int solved() const { return size() - static_cast<int>(coming_.size()); }
  /// Empty for a pose that the estimator has.
  const Ahead& ahead(int pose) const;
  /// What is coming, as an update.
  GraphUpdate coming() const { return odometry_from(solved()); }
  /// With what is coming, if there is anything. Throws before anything has changed.
  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options = {});
  /// The estimator with what was passed to it. Only to be read.
  Estimator& estimator() const { return *estimator_; }
  /// With everything that is kept: the estimator, or while poses are coming, a copy that has them.
  /// Good until the graph changes; reading it changes no later result.
  Estimator& whole();
  /// Takes an earlier state of the estimator back.
  void restore(std::unique_ptr<Estimator> estimator) { estimator_ = std::move(estimator); }

  /// Σ_ik of poses that the estimator has.
  Matrix covariance(int i, int k) const;
  /// From one to the other, with its covariance; likewise.
  Displacement between(int i, int k) const;

 private:
  struct Kept {
    Id id = 0;
    PlacedState placed{};
  };
  /// For readers: an estimator with the first so many poses, or null.
  struct Copy {
    std::unique_ptr<Estimator> estimator;
    int poses = 0;
  };

  GraphUpdate odometry_from(int first) const;

  std::unique_ptr<Estimator> estimator_;
  Copy copy_;
  std::unique_ptr<RigidGroup> group_;
  std::vector<Kept> kept_;
  std::vector<Coming> coming_;  ///< the last of them
  std::unordered_map<Id, int> number_;
  std::unique_ptr<PoseIndex> index_;
};

}  // namespace cairn::compact
