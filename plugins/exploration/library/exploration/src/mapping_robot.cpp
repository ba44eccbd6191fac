// SPDX-License-Identifier: BSD-3-Clause
#include "mapping_robot.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/evaluation/normalized_error.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/exploration/exploration_measures.hpp"

namespace cairn {
namespace {

double area_of(const GridFrame& grid) {
  return static_cast<double>(grid.size()) * grid.cell_area();
}

void log(ScanLog& log, const Pose2& odometry, const LaserScan& scan,
         const std::optional<Pose2>& truth) {
  constexpr double kSecondsPerMotion = 1.0;  // a run has no clock
  log.scans.push_back({.stamp = kSecondsPerMotion * static_cast<double>(log.scans.size()),
                       .odometry = odometry,
                       .scan = scan,
                       .truth = truth});
}

}  // namespace

MappingRobot::MappingRobot(const Exploration& parts)
    : parts_(parts),
      model_(parts.world.robot()),
      slam_({.policy = parts.policy,
             .registration = parts.registration,
             .mapper = parts.mapper,
             .registry = parts.registry,
             .match_consecutive = parts.match_consecutive,
             .loop_loss = parts.loop_loss}) {}

void MappingRobot::begin() {
  LaserScan scan = parts_.world.begin(parts_.start);
  const std::optional<Pose2> truth = parts_.world.truth();
  if (parts_.log) log(*parts_.log, Pose2(), scan, truth);
  slam_.begin(Pose2(), std::move(scan), model_.odometry, Pose2(model_.step, 0.0, 0.0), truth);
  parts_.explorer.begin(parts_.start.seed);
  record(0.0, 0);
}

MadeMotion MappingRobot::move(const Pose2& motion, int decisions) {
  const std::optional<Pose2> from = parts_.world.truth();
  WorldStep step = parts_.world.move(motion);
  collisions_ += step.collided;
  const std::optional<Pose2> to = parts_.world.truth();
  MadeMotion made{.moved = from && to ? from->between(*to) : step.odometry,
                  .odometry = step.odometry,
                  .collided = step.collided};
  if (parts_.log && !parts_.log->scans.empty())
    log(*parts_.log, parts_.log->scans.back().odometry * step.odometry, step.scan, to);
  const Pose2 expected = slam_.pose() * step.odometry;
  slam_.add(step.odometry, step.covariance, std::move(step.scan), to);
  watch_matches(made.driven());
  record(made.driven(), decisions);
  made.jump = (slam_.pose().translation() - expected.translation()).norm();
  return made;
}

/// How far the robot drives between two scans that are matched with another one.
void MappingRobot::watch_matches(double driven) {
  const int matched = slam_.counts().consecutive + slam_.counts().loops;
  unmatched_ = matched > std::exchange(matched_, matched) ? 0.0 : unmatched_ + driven;
  longest_unmatched_ = std::max(longest_unmatched_, unmatched_);
}

void MappingRobot::record(double driven, int decisions) {
  const FloorMap& map = slam_.map();
  const std::vector<Id> kept = parts_.policy.kept();
  // The map's grid grows, so that its entropy alone is over another area at each step.
  const double area = area_of(parts_.start.floor ? parts_.start.floor->frame : map.frame);
  ExplorationStep step{
      .step = static_cast<int>(steps_.size()),
      .decision = decisions,
      .distance = driven,
      .estimate = slam_.pose(),
      .truth = truth_as_estimated(),
      .coverage = map.coverage(),
      .map_entropy = entropy_of_area(map.entropy(), area_of(map.frame), area),
      .grid_area = area,
      .trajectory_entropy = trajectory_entropy(parts_.policy.estimator(), kept, parts_.first_sigma),
      .kept = static_cast<int>(kept.size()),
      .loops = slam_.counts().loops,
      .collisions = collisions_};
  if (!steps_.empty()) step.distance += steps_.back().distance;
  steps_.push_back(step);
  sample_map();
  if (parts_.moved) parts_.moved(step, map);
  if (parts_.scanned) parts_.scanned(step, situation(map, kept, decisions), slam_.scans().back());
}

/// Where the robot truly is, in the frame of the estimate.
std::optional<Pose2> MappingRobot::truth_as_estimated() {
  const std::optional<Pose2> truth = parts_.world.truth();
  if (!truth) return std::nullopt;
  if (!start_) {
    start_ = *truth * slam_.pose().inverse();
    first_truth_ = truth->translation();
  }
  return start_->between(*truth);
}

Situation MappingRobot::situation(const FloorMap& map, std::span<const Id> kept,
                                  int decisions) const {
  MatchModel match = parts_.match;
  match.loop_gain = parts_.policy.link_gain().value_or(match.loop_gain);
  return {.estimator = parts_.policy.estimator(),
          .poses = kept,
          .pose = slam_.pose(),
          .map = map,
          .robot = model_,
          .decision = decisions,
          .match = match,
          .first_sigma = parts_.first_sigma,
          .budget = parts_.decision_budget,
          .interrupt = parts_.interrupt};
}

// The map beside the floor ------------------------------------------------------------------------

/// Every so many metres.
void MappingRobot::sample_map() {
  const double next = static_cast<double>(samples_.size()) * parts_.sample_distance;
  if (!std::isfinite(next) || driven() < next) return;
  samples_.push_back(map_sample(recovered_trajectory(parts_.policy, Recovery::distribute)));
}

MapSample MappingRobot::map_sample(const Graph& estimate) {
  const FloorMap& map = slam_.map();
  return {.distance = driven(),
          .coverage = map.coverage(),
          .error = contradicted_area(map, slam_.scans(), slam_.poses()),
          .against = beside_floor(estimate)};
}

double MappingRobot::reachable_seen() {
  const auto against = beside_floor(recovered_trajectory(parts_.policy, Recovery::distribute));
  return against ? against->reachable_seen.value_or(0.0) : 0.0;
}

/// None: the floor is not known, or not how the map lies on it.
std::optional<MapTruth> MappingRobot::beside_floor(const Graph& estimate) {
  if (!parts_.start.floor || !start_) return std::nullopt;
  const std::optional<Pose2> to_floor = alignment(estimate);
  if (!to_floor) return std::nullopt;
  return compare_with_floor(slam_.map(), *parts_.start.floor, *to_floor, first_truth_,
                            parts_.reachable);
}

/// From the world of the estimate to that of the floor; none: the true poses do not determine it.
std::optional<Pose2> MappingRobot::alignment(const Graph& estimate) const {
  constexpr int kFewest = 3;  // poses that determine one
  const auto known = slam_.truth().variable_count();
  if (known < kFewest) {
    // Of a run that has just begun the first pose does.
    return known == estimate.variable_count() ? start_ : std::nullopt;
  }
  const Pose pose = align(pair_by_id(trajectory(estimate), trajectory(slam_.truth())));
  return Pose2(pose.t.x(), pose.t.y(), std::atan2(pose.R(1, 0), pose.R(0, 0)));
}

ExplorationResult MappingRobot::finish() {
  ExplorationResult result;
  result.converged = slam_.finish();
  result.map = slam_.map();
  result.slam = slam_.counts();
  result.start = start_;
  result.collisions = collisions_;
  result.graph = parts_.policy.estimator().graph();
  result.trajectory = recovered_trajectory(parts_.policy, Recovery::distribute);
  result.truth_trajectory = slam_.truth().clone();
  samples_.push_back(map_sample(result.trajectory));
  result.map_error = samples_.back().error;
  result.against = samples_.back().against;
  result.steps = std::move(steps_);
  result.samples = std::move(samples_);
  Estimator& estimator = parts_.policy.estimator();
  std::vector<Id> kept = parts_.policy.kept();
  std::ranges::sort(kept);
  result.expected_ate = expected_ate(estimator, estimator.graph(), evenly_spread(kept));
  return result;
}

}  // namespace cairn
