// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "cairn/geometry/pose.hpp"
#include "kept_poses.hpp"

namespace cairn::compact {

/// Measurements of a landmark that have left the graph, by their poses.
struct LeftOut {
  Variable landmark;     ///< without a state
  bool removed = false;  ///< the landmark itself has left, these being all that was measured of it
  std::vector<std::pair<Id, Factor>> factors;
};

/// The landmarks of a compact graph, in the estimator of its poses. They, and measurements of them,
/// leave it again where with them the estimate has no covariance: a landmark that has moved so far
/// away that its bearings leave its distance open, or one that the estimate has drawn to a pose
/// that measured its bearing.
class GraphLandmarks {
 public:
  /// `kept`: of which variables the estimator keeps the covariances.
  explicit GraphLandmarks(KeptMarginals kept) : keeps_all_(kept == KeptMarginals::diagonal) {}

  /// In the order in which they were added.
  const std::vector<Id>& ids() const { return ids_; }
  bool empty() const { return ids_.empty(); }
  /// The type of one; null: it is not in the graph.
  const VariableType* type(Id id) const;
  /// One that the estimator has now.
  void add(Id id, std::shared_ptr<const VariableType> type);

  /// Whether the estimate has a covariance of every pose and landmark; where the estimator does not
  /// keep them, of those that were measured. `gone`: poses that have left it already.
  bool determined(std::span<const Id> measured, const KeptPoses& poses,
                  const std::unordered_set<Id>& gone = {}) const;
  /// After an update that has left variables without a covariance; `measured`: what its factors are
  /// on. Mostly it is enough to relinearise: on its way to the estimate a landmark came close to a
  /// pose. If not, what is not linear leaves; if that is not it, the landmarks that were measured
  /// last; and if that is not it either, as where false measurements have moved everything, all
  /// landmarks: odometry determines the poses.
  void restore_covariances(std::span<const Id> measured, KeptPoses& poses);
  /// Takes those of these that are landmarks out, with all that was measured of them; the estimate
  /// is as before.
  void leave_out(std::span<const Id> landmarks, KeptPoses& poses);
  /// What has left since this was called last.
  std::vector<LeftOut> take_left_out() { return std::exchange(left_out_, {}); }

  /// Adds to an update that takes all out, and to one that adds them again, moved.
  void move(const Pose& by, const KeptPoses& poses, GraphUpdate& leaving,
            GraphUpdate& coming) const;

 private:
  struct Measurement {
    FactorId id = 0;
    Id pose = 0;
    Factor factor;
  };

  std::map<Id, std::vector<Measurement>> measurements(const KeptPoses& poses) const;
  std::vector<std::size_t> not_linear(Id of, std::span<const Measurement> measured,
                                      const KeptPoses& poses) const;
  void leave_out(Id of, std::span<const Measurement> measured, bool with_landmark,
                 KeptPoses& poses);
  bool leave_out_not_linear(KeptPoses& poses);
  bool solved_anew(std::span<const Id> measured, KeptPoses& poses) const;

  bool keeps_all_;
  std::vector<Id> ids_;
  std::unordered_map<Id, std::shared_ptr<const VariableType>> types_;
  std::vector<LeftOut> left_out_;
};

}  // namespace cairn::compact
