// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/map_truth.hpp"
#include "cairn/exploration/scan_log.hpp"
#include "cairn/exploration/scan_slam.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {

/// When a run ends, besides for want of anything to explore.
struct ExplorationLimits {
  double distance = std::numeric_limits<double>::infinity();  ///< driven [m]
  int steps = std::numeric_limits<int>::max();                ///< motions
  int decisions = std::numeric_limits<int>::max();
  /// Part of what the body can cover that is seen (`MapTruth::reachable_seen`), looked at every
  /// 0.5 m: only where the floor is known (`Exploration::reachable`).
  double known = std::numeric_limits<double>::infinity();
  /// Floor that the last `kRateDistance` metres brought per metre [m²/m]: less ends the run.
  double rate = 0.0;
  static constexpr double kRateDistance = 20.0;
  /// Driven without a discovery (`DiscoveredFloor`) [m]: then it is stuck. Of the way of each
  /// decision a fifth of this counts at most.
  double idle_distance = 50.0;
};

enum class ExplorationEnd { finished, limit, stuck, interrupted };
/// "finished", "limit", "stuck", "interrupted".
CAIRN_API std::string_view to_string(ExplorationEnd end);

/// A run after one motion; the first is of its start.
struct ExplorationStep {
  int step = 0, decision = 0;
  /// Driven so far [m]: as it truly was, where that is known, else by odometry.
  double distance = 0.0;
  Pose2 estimate;
  /// In the frame of the estimate: both begin at the same pose.
  std::optional<Pose2> truth;
  double coverage = 0.0;            ///< `FloorMap::coverage` [m²]
  double map_entropy = 0.0;         ///< (5.6), over `grid_area` [nats·m²]
  double grid_area = 0.0;           ///< of the floor's grid; if not known, of the map's [m²]
  double trajectory_entropy = 0.0;  ///< (5.13): see `trajectory_entropy` [nats]
  int kept = 0, loops = 0, collisions = 0;

  CAIRN_API static ResultFields<ExplorationStep> fields();
};

/// How good the map is at some point of a run.
struct MapSample {
  double distance = 0.0;            ///< driven by then [m]
  double coverage = 0.0;            ///< `FloorMap::coverage` [m²]
  double error = 0.0;               ///< `contradicted_area` [m²]
  std::optional<MapTruth> against;  ///< beside the floor, where that is known
};

struct ExplorationResult {
  ExplorationEnd end = ExplorationEnd::finished;
  std::string why;  ///< a sentence
  std::vector<ExplorationStep> steps;
  std::vector<MapSample> samples;  ///< as `Exploration::sample_distance` asks for, and of the end
  std::vector<double> decision_seconds;
  std::vector<std::string> notes;
  Graph graph;       ///< of the poses that are kept
  Graph trajectory;  ///< of all poses, without factors
  /// Where the estimate's frame lies in that of the world, by the first true pose; none: not known.
  std::optional<Pose2> start;
  /// Of all poses, in the frame of the world; without variables if it is not known.
  Graph truth_trajectory;
  FloorMap map;
  /// Absolute trajectory error that the covariances predict (`cairn::expected_ate`) [m].
  double expected_ate = 0.0;
  double map_error = 0.0;           ///< `contradicted_area` [m²]
  std::optional<MapTruth> against;  ///< beside the floor, where that is known
  bool converged = true;
  int collisions = 0;
  double decide_seconds = 0.0;
  ScanSlamCounts slam;
};

/// What a run consists of. Everything referred to must outlive it.
struct Exploration {
  World& world;
  PosePolicy& policy;
  Registration& registration;
  Mapper& mapper;
  Explorer& explorer;
  Registry& registry;
  WorldStart start;
  /// By cell of the floor to drive on: whether the robot's body can cover it
  /// (`FloorSurvey::covered`), for `MapTruth::reachable_seen`. Empty: not known.
  std::span<const std::uint8_t> reachable = {};
  ExplorationLimits limits;
  /// Standard deviations of the first pose [m, m, rad], for `trajectory_entropy` and the explorer.
  Eigen::Vector3d first_sigma = Eigen::Vector3d(0.05, 0.05, 0.0017);
  MatchModel match = {};  ///< what the explorer expects of loop closures
  /// Within which an explorer that can stop early should decide [s]. A run with a budget depends
  /// on the clock, and cannot be repeated exactly.
  double decision_budget = std::numeric_limits<double>::infinity();
  /// How far the robot drives between two samples of its map [m].
  double sample_distance = std::numeric_limits<double>::infinity();
  const std::atomic<bool>* interrupt = nullptr;
  /// Called after each decision, with the map and where the robot is.
  std::function<void(const Decision&, const Situation&)> decided = {};
  /// Called after each motion.
  std::function<void(const ExplorationStep&, const FloorMap&)> moved = {};
  /// The same with all that a recording holds: graph and map as the explorer would be given them,
  /// and the scan that was taken at the end of the motion.
  std::function<void(const ExplorationStep&, const Situation&, const LaserScan&)> scanned = {};
  /// As in `ScanSlamParts`: for odometry of real wheels, and for matches that may be wrong.
  bool match_consecutive = false;
  std::shared_ptr<const Loss> loop_loss = nullptr;
  /// The motions as odometry has them, and all scans, with the true poses if they are known. None:
  /// they are not wanted.
  ScanLog* log = nullptr;
};

/// Explores: decides, drives along the path that was chosen, and maps, until nothing is left to
/// explore or a limit is reached. A path is given up, and the explorer asked again, when an
/// obstacle is seen on it, when the robot collides, or when a loop closure moves the estimate by
/// more than a cell of the map.
///
/// A world that is `RecordedWorld` goes where it went, until its recording ends, and the explorer
/// is not asked.
///
/// The frame of the estimate is that of the robot where it begins: it does not know where it is on
/// a floor, nor at which angle.
///
/// Each motion is a pose of the graph with a relative factor from odometry; the policy decides
/// which are kept and which are registered with each other (thesis, 5.1). Throws `Error` as its
/// parts do.
CAIRN_API ExplorationResult run_exploration(const Exploration& parts);

/// (1/n) Σ ln((2πe)^{3/2} |Σ_ii|) over these poses in the plane (thesis, 5.13, with the entropy of
/// a pose as in 5.5, without the root of the determinant), if the first of them, which is fixed,
/// had a prior with the standard deviations `first_sigma` [m, m, rad] instead. NaN where H is
/// singular.
CAIRN_API double trajectory_entropy(Estimator& estimator, std::span<const Id> poses,
                                    const Eigen::Vector3d& first_sigma);

}  // namespace cairn
