// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/policy/id_runs.hpp"
#include "cairn/policy/pose_policy.hpp"

namespace cairn {

/// What the lines of a session with a policy have brought: the poses so far, and of the newest what
/// the policy has not been given yet. Knows which line may follow which: the functions throw
/// `Error` (input), and change nothing, where one may not.
class PoseIntake {
 public:
  /// What was measured between the newest pose and another one.
  struct Measured {
    Id other = 0;
    std::vector<Factor> factors;
  };
  /// A pose with its odometry from the one before.
  struct Arriving {
    Variable pose;
    std::vector<Factor> odometry;
  };

  /// The poses and landmarks of a map that those which come continue.
  void load(const Graph& map);

  // The poses so far
  /// Of the poses' type; none before the first.
  const std::optional<MotionGroup>& motions() const { return motions_; }
  /// The newest that the policy has.
  std::optional<Id> newest() const { return newest_; }
  /// The one that arrives, or is open: the policy has it, and it has not ended.
  std::optional<Id> current() const;
  const std::optional<Arriving>& arriving() const { return arriving_; }
  /// Whether the pose that arrives can be handed over; true if none does.
  bool complete() const { return !arriving_ || !newest_ || !arriving_->odometry.empty(); }
  void expect_complete() const;
  /// Whether a pose with this id has come and ended.
  bool has_ended(Id id) const { return arrived_.contains(id); }
  /// Of poses that have ended.
  bool is_kept(Id id) const { return kept_.contains(id); }
  /// The one of two ids that is not the pose of now.
  Id other_end(std::span<const Id> ends) const;
  void expect_kept(Id id) const;
  /// Landmarks that were declared, or are on the map.
  bool is_landmark(Id id) const { return landmarks_.contains(id); }

  // Lines of data
  /// Brings the state of a new pose into canonical form.
  void check_pose(Variable& pose) const;
  void arrive(Variable pose);
  /// That only the pose which arrives is among them.
  void expect_arriving(std::span<const Id> ids) const;
  void hold() { arriving_->pose.fixed = true; }
  void add_landmark(const Variable& landmark);
  /// True if the factor between the pose of now and `other` is its odometry, which is taken.
  bool take_odometry(Factor& factor, Id other);
  void check_prior(const Factor& prior) const;
  /// Whether a factor is for a landmark: between the pose of now and anything else that is no pose.
  bool is_observation(const Factor& factor) const;
  void check_observation(const Factor& factor) const;

  void add_measured(Id other, Factor factor);
  void add_prior(Factor prior) { priors_.push_back(std::move(prior)); }
  void add_observation(Factor factor);
  const std::optional<Measured>& measured() const { return measured_; }

  // To the policy
  /// The policy has the pose that arrived.
  void begun();
  std::optional<Measured> take_measured() { return std::exchange(measured_, std::nullopt); }
  std::vector<Factor> take_priors() { return std::exchange(priors_, {}); }
  std::vector<LandmarkObservation> take_observations() { return std::exchange(observations_, {}); }
  /// The open pose has ended.
  void ended(Id id, bool kept);
  void note_kept(Id id) { kept_.insert(id); }
  /// A kept pose has left the graph.
  void left(Id id);
  /// As if the pose that arrives, if one does, had not come.
  void withdraw();

 private:
  void check_motion(const Factor& factor, Id from) const;

  std::optional<MotionGroup> motions_;
  IdRuns arrived_;               ///< all poses that ever came
  std::unordered_set<Id> kept_;  ///< those that are in the graph, but for the open pose
  bool some_left_ = false;
  std::unordered_map<Id, std::shared_ptr<const VariableType>> landmarks_;

  std::optional<Arriving> arriving_;
  std::optional<Id> newest_, before_;
  bool open_ = false;
  std::optional<Measured> measured_;               ///< and not offered
  std::vector<Factor> priors_;                     ///< of the open pose
  std::vector<LandmarkObservation> observations_;  ///< likewise
};

}  // namespace cairn
