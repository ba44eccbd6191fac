// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/scan_slam.hpp"

namespace cairn {

/// A motion of a robot, as it was made.
struct MadeMotion {
  Pose2 moved;        ///< as it truly was, where that is known, else by odometry
  Pose2 odometry;     ///< which is noisy and adds up to more
  double jump = 0.0;  ///< of the estimate, from where odometry leads [m]
  bool collided = false;

  double driven() const { return moved.translation().norm(); }  ///< [m]
};

/// The robot of a run with graph and map as it makes them: each motion is a scan, a pose of the
/// graph, and a step of the result.
class MappingRobot {
 public:
  /// `parts` must outlive it.
  explicit MappingRobot(const Exploration& parts);

  /// Takes the first scan.
  void begin();
  /// After so many decisions.
  MadeMotion move(const Pose2& motion, int decisions);
  /// All of a result but its end and its decisions.
  ExplorationResult finish();

  const RobotModel& model() const { return model_; }
  const ScanSlam& slam() const { return slam_; }
  const Pose2& pose() const { return slam_.pose(); }  ///< as estimated
  const FloorMap& map() { return slam_.map(); }
  const std::vector<ExplorationStep>& steps() const { return steps_; }
  double driven() const { return steps_.back().distance; }  ///< [m]
  double longest_unmatched() const { return longest_unmatched_; }
  /// Of what the body can cover, the part that the map knows; 0: that is not known.
  double reachable_seen();
  /// What an explorer decides upon, with a map of its own; `kept`: the poses of the graph.
  Situation situation(const FloorMap& map, std::span<const Id> kept, int decisions) const;

 private:
  void record(double driven, int decisions);
  std::optional<Pose2> truth_as_estimated();
  void sample_map();
  MapSample map_sample(const Graph& estimate);
  std::optional<MapTruth> beside_floor(const Graph& estimate);
  std::optional<Pose2> alignment(const Graph& estimate) const;
  void watch_matches(double driven);

  const Exploration& parts_;
  RobotModel model_;
  ScanSlam slam_;
  std::vector<ExplorationStep> steps_;
  std::vector<MapSample> samples_;
  int collisions_ = 0;
  std::optional<Pose2> start_;                             // `ExplorationResult::start`
  Eigen::Vector2d first_truth_ = Eigen::Vector2d::Zero();  // position [m], with `start_`
  int matched_ = 0;                                        // scans, with one before
  double unmatched_ = 0.0, longest_unmatched_ = 0.0;       // driven between two of them [m]
};

}  // namespace cairn
