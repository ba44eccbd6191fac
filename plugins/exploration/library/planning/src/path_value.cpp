// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_value.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "cairn/planning/path_motions.hpp"
#include "in_sight.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

PathInformationOptions with_entropy(PathInformationOptions options, EntropyForm entropy) {
  options.entropy = entropy;
  return options;
}

bool is_same(const Pose2& a, const Pose2& b) {
  constexpr double kRounding = 1e-9;  // of the sum of turns
  return std::abs(a.x() - b.x()) < kRounding && std::abs(a.y() - b.y()) < kRounding &&
         std::abs(std::remainder(a.theta() - b.theta(), 2.0 * std::numbers::pi)) < kRounding;
}

/// The poses whose scans matter. Where the one before and the one after it overlap a scan is left
/// out: while the robot turns on the spot and, along the short motions of one that can't, until it
/// has driven a step.
std::vector<Pose2> scanning_poses(const Pose2& start, const std::vector<Pose2>& motions,
                                  const RobotModel& robot) {
  const double apart = robot.motion == MotionModel::dubins ? robot.step : 0.0;
  std::vector<Pose2> poses;
  Pose2 pose = start;
  double driven = 0.0, turned = 0.0;  // since the last scan that counts
  for (std::size_t k = 0; k < motions.size(); ++k) {
    pose = pose * motions[k];
    driven += motions[k].translation().norm();
    turned += std::abs(motions[k].theta());
    const bool left_out = k + 1 < motions.size() &&
                          driven + motions[k + 1].translation().norm() <= apart &&
                          turned + std::abs(motions[k + 1].theta()) <= robot.lidar.aperture;
    if (left_out) continue;
    poses.push_back(pose);
    driven = turned = 0.0;
  }
  return poses;
}

}  // namespace

PathValue::PathValue(const Situation& situation, const PathValueOptions& options,
                     std::span<const Vector2d> left_out)
    : situation_(situation),
      objective_(options.objective, situation.map.frame.resolution, situation.robot.lidar.range),
      information_(situation, with_entropy(options.information, options.objective.entropy),
                   [&map = situation.map](const Pose2& older, const Pose2& newer) {
                     return in_sight(map, older, newer);
                   }),
      seen_(situation.map, situation.robot.lidar,
            std::min(options.simulated_range, situation.robot.lidar.range)),
      now_(information_.start().covariance()),
      map_now_(options.objective.alpha == AlphaForm::both ? situation.map.entropy() : 0.0) {
  seen_.leave_out(left_out);
}

PathValue::State PathValue::root(const Vector2d&) const {
  return {.information = information_.start(),
          .seen = std::make_shared<const CellSet>(seen_.none())};
}

PathValue::State PathValue::extended(const State& path, const Vector2d&, const Vector2d& to,
                                     const State* before) {
  State next{.information = path.information};
  next.segment = segment(path.information.pose(), to, before);
  next.information = information_.extended(path.information, next.segment->motions);
  next.cells = path.cells + path.seen->missing(next.segment->seen);
  evaluate(next, next.information.estimated_trajectory_change());
  return next;
}

PathValue::State PathValue::evaluated(State path) const {
  evaluate(path, path.information.trajectory_change());
  path.is_exact = true;
  return path;
}

PathValue::State PathValue::adopted(State path, const State& parent) const {
  path.seen = parent.seen;
  if (path.cells == parent.cells) return path;
  auto seen = std::make_shared<CellSet>(*parent.seen);
  seen->add(path.segment->seen);
  path.seen = std::move(seen);
  return path;
}

std::shared_ptr<const PathValue::Segment> PathValue::segment(const Pose2& start, const Vector2d& to,
                                                             const State* before) const {
  if (before && before->segment && is_same(before->segment->start, start)) return before->segment;
  auto segment = std::make_shared<Segment>();
  segment->start = start;
  const PlannedPath path{.points = {to}, .length = (to - start.translation()).norm()};
  segment->motions = motions_along(start, path, situation_.robot);
  const std::vector<Pose2> poses = scanning_poses(start, segment->motions, situation_.robot);
  if (!poses.empty()) segment->seen = seen_.look(poses);
  return segment;
}

void PathValue::evaluate(State& path, double trajectory_change) const {
  path.change = objective_.change(trajectory_change, seen_.entropy_change(path.cells), now_,
                                  path.information.covariance());
  if (path.information.steps() == 0) return;
  path.value = objective_.value(path.change, map_now_, now_) /
               std::max(path.information.length(), situation_.robot.step);
}

}  // namespace cairn
