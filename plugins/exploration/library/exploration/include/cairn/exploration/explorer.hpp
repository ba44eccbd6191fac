// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/path_planner.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// Which pairs of poses can be matched, and how well: what an explorer expects of loop closures.
struct MatchModel {
  /// Largest offset forward, and to the left, in the frame of the older pose [m].
  double range = 1.0;
  double angle = 0.35;  ///< largest difference of the headings [rad]
  /// Standard deviations of a match [m, m, rad].
  Eigen::Vector3d sigma = Eigen::Vector3d(0.05, 0.05, 0.0017);
  /// Information gain that a loop closure must exceed to be made [nats]: that of `compact_pose` by
  /// default. `run_exploration` has that of its policy here, where the policy decides by it.
  double loop_gain = 1.64;

  /// What an option of an explorer chose, or `loop_gain` where that is negative.
  double loop_gain_unless(double chosen) const { return chosen < 0.0 ? loop_gain : chosen; }
  Eigen::Matrix3d covariance() const { return sigma.array().square().matrix().asDiagonal(); }
};

/// What an explorer decides upon.
struct Situation {
  Estimator& estimator;       ///< only to be read, which changes no later result
  std::span<const Id> poses;  ///< those that are kept, in the order of arrival
  Pose2 pose;                 ///< where the robot is, as estimated
  const FloorMap& map;
  const RobotModel& robot;
  int decision = 0;  ///< how many came before
  MatchModel match = {};
  /// Standard deviations of the first pose [m, m, rad], which the graph holds: with those it would
  /// have a prior.
  Eigen::Vector3d first_sigma = Eigen::Vector3d(0.05, 0.05, 0.0017);
  /// Within which an explorer that can stop early should decide [s].
  double budget = std::numeric_limits<double>::infinity();
  /// Becomes true when the run is to end at once; null: it never does. An explorer whose decision
  /// takes long looks at it on the way, and returns any decision then: it is not used.
  const std::atomic<bool>* interrupt = nullptr;

  bool interrupted() const { return interrupt && interrupt->load(std::memory_order_relaxed); }
};

/// What a path is expected to do to the entropies of trajectory and map; a decrease is negative.
struct InformationChange {
  double trajectory = 0.0;  ///< [nats]
  double map = 0.0;         ///< [nats·m²]
  double alpha = 1.0;       ///< factor of the map's, from the uncertainty of the robot's pose
};

/// A path that was considered.
struct Candidate {
  PlannedPath path;
  double value = 0.0;  ///< by which they are compared: the least is best
  std::string what;    ///< "frontier of 3.2 m"
  /// What the path is expected to do; none: it was not evaluated.
  std::optional<InformationChange> change = {};
};

/// A pose of a tree of paths, as an explorer has searched it: for pictures.
struct TreePose {
  Pose2 pose;
  int parent = -1;     ///< the pose before, of an earlier index or not; -1: the root
  double value = 0.0;  ///< of the path up to here, as `Candidate::value`
};

struct Decision {
  enum class Kind {
    drive,     ///< along `candidates[chosen]`
    finished,  ///< nothing is left
    stuck      ///< something is left, and there is no path to it
  };
  Kind kind = Kind::drive;
  std::string why;  ///< a sentence
  std::vector<Candidate> candidates;
  std::size_t chosen = 0;
  std::vector<std::string> notes;
  std::vector<TreePose> tree = {};  ///< of an explorer that grows one
};

/// Chooses where a robot drives next to explore a floor.
class CAIRN_API Explorer : public Component {
 public:
  static constexpr std::string_view kKind = "explorer";
  ~Explorer() override;

  /// Called before the first decision of a run.
  virtual void begin(std::uint64_t seed) = 0;
  virtual Decision decide(const Situation& situation) = 0;
  /// Called after each motion along a path that it has chosen: false if what it led to is known by
  /// now, so that it decides anew. Unless overridden, every path is driven to its end.
  virtual bool is_worthwhile(const Situation& situation, const PlannedPath& path);
};

}  // namespace cairn
