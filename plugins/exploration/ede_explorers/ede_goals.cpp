// SPDX-License-Identifier: BSD-3-Clause
#include "ede_goals.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::exploration {
namespace {

/// So near to a goal the robot has been there [m], [rad].
constexpr double kThere = 0.3, kThereAngle = 0.2;
/// Goals nearer to each other count as the same [m]; and so many decisions for one are enough.
constexpr double kSameGoal = 0.5;
constexpr int kMostTries = 4;
/// The known floor must grow by this factor to be a discovery.
constexpr double kDiscovery = 1.002;
/// Directions and orientations may be divided by this at most: at the end of beams of 8 m, 360 / 4
/// are 0.56 m apart. And so many are left of them.
constexpr int kCoarsest = 4, kFewest = 16;
/// What a field has taken per cell and direction counts so much less with each field.
constexpr double kFading = 0.7;
/// What is left of the frontier cells in sight of a goal that is worth driving to.
constexpr double kLeft = 0.5;

}  // namespace

Situation adapted(const Situation& situation, const RobotModel& robot, double budget) {
  return {.estimator = situation.estimator,
          .poses = situation.poses,
          .pose = situation.pose,
          .map = situation.map,
          .robot = robot,
          .decision = situation.decision,
          .match = situation.match,
          .first_sigma = situation.first_sigma,
          .budget = budget,
          .interrupt = situation.interrupt};
}

RobotModel narrowed(const RobotModel& robot, const GridFrame& frame) {
  RobotModel result = robot;
  result.radius = narrow_radius(robot.radius, frame);
  return result;
}

Decision end_decision(Decision::Kind kind, std::string why) {
  Decision decision;
  decision.kind = kind;
  decision.why = std::move(why);
  return decision;
}

bool moves(const Situation& situation, const PlannedPath& path) {
  std::size_t passed = 0;
  return next_motion(situation.pose, path, situation.robot, passed).has_value();
}

void EdeGoals::begin() {
  given_up_.begin();
  goal_.reset();
  coverage_ = 0.0;
  revisits_ = 0;
  tight_ = false;
  beam_cell_ = 0.0;
}

double EdeGoals::smallest(const Situation& situation) const {
  return options_.smallest > 0.0 ? options_.smallest : 2.0 * situation.robot.radius;
}

ReachableField EdeGoals::field(const Situation& situation, bool tight, double seconds) {
  review_goal(situation);
  tight_ = tight;
  const double coverage = situation.map.coverage();
  if (coverage > kDiscovery * coverage_) {
    coverage_ = coverage;
    revisits_ = 0;
  }
  // What it would take in full, by the last one.
  const double whole =
      beam_cell_ * static_cast<double>(situation.map.frame.size()) * options_.field.directions;
  int part = 1;
  while (part < kCoarsest && whole / part > seconds) part *= 2;
  ReachableField result = field_with(situation, tight, part);
  if (result.coarse && !result.discovers) result = field_with(situation, tight, 1);
  return result;
}

ReachableField EdeGoals::field_with(const Situation& situation, bool tight, int part) {
  const auto begin = std::chrono::steady_clock::now();
  ReachableField result;
  result.coarse = part > 1;
  result.cells = beam_cells(situation.map);
  given_up_.remove_from(result.cells, situation.map, smallest(situation));
  const RobotModel robot = tight ? narrowed(situation.robot, situation.map.frame) : situation.robot;
  const bool loops = options_.revisits == 0 || revisits_ < options_.revisits;
  EntropyFieldOptions options = options_.field;
  const auto fewer = [&](int count) { return std::max(count / part, std::min(count, kFewest)); };
  options.directions = fewer(options.directions);
  options.orientations = fewer(options.orientations);
  result.field = std::make_unique<EntropyField>(
      adapted(situation, robot, situation.budget), options,
      EntropyField::Parts{.cells = result.cells, .loop_closures = loops});
  const ConfigurationSpace& space = result.field->space();
  result.lengths = path_lengths(space, situation.map, situation.pose.translation());
  for (const float length : result.lengths) result.reachable.push_back(std::isfinite(length));
  for (std::size_t k = 0; k < space.size() && !result.discovers; ++k) {
    result.discovers = result.field->seen(k) >= 1.0 &&
                       result.reachable[static_cast<std::size_t>(space.number_of(k))] != 0;
  }
  const double work = static_cast<double>(situation.map.frame.size()) * options.directions;
  beam_cell_ = std::max(seconds_since(begin) / work, kFading * beam_cell_);
  return result;
}

/// What became of the last goal.
void EdeGoals::review_goal(const Situation& situation) {
  if (!goal_) return;
  const Pose2 apart = goal_->pose.between(situation.pose);
  const bool there = apart.translation().norm() < kThere && std::abs(apart.theta()) < kThereAngle;
  if (!there && goal_->tries < kMostTries) return;
  const RobotModel robot =
      tight_ ? narrowed(situation.robot, situation.map.frame) : situation.robot;
  const ConfigurationSpace space(situation.map, robot.radius, options_.field.orientations);
  if (const auto configuration = space.nearest(goal_->pose)) {
    given_up_.add(situation.map, frontiers_seen_from(space, beam_cells(situation.map), robot.lidar,
                                                     options_.field.directions, *configuration));
  }
  goal_.reset();
}

void EdeGoals::give_up(const Situation& situation, const ReachableField& at,
                       std::size_t configuration) {
  given_up_.add(situation.map,
                frontiers_seen_from(at.field->space(), at.cells, situation.robot.lidar,
                                    options_.field.directions, configuration));
  ++revisits_;
  goal_.reset();
}

void EdeGoals::chosen(const ReachableField& at, std::size_t configuration) {
  const InformationChange change = at.field->change(configuration);
  Goal goal{.pose = at.field->space().pose(configuration),
            .seen = at.field->seen(configuration),
            .discovers = change.alpha * change.map <= change.trajectory};
  if (goal_ && (goal_->pose.translation() - goal.pose.translation()).norm() < kSameGoal)
    goal.tries = goal_->tries + 1;
  if (!goal.discovers) ++revisits_;
  goal_ = goal;
}

bool EdeGoals::is_worthwhile(const Situation& situation) const {
  if (!goal_ || !goal_->discovers) return true;
  const RobotModel robot =
      tight_ ? narrowed(situation.robot, situation.map.frame) : situation.robot;
  const ConfigurationSpace space(situation.map, robot.radius, options_.field.orientations);
  const auto configuration = space.nearest(goal_->pose);
  if (!configuration) return false;
  double seen = 0.0;
  for (const SeenFrontier& frontier :
       frontiers_seen_from(space, beam_cells(situation.map), robot.lidar, options_.field.directions,
                           *configuration))
    seen += frontier.part;
  return seen >= kLeft * goal_->seen;
}

std::string EdeGoals::end_text(const Situation& situation) const {
  return fmt::format("no frontier of {:g} m or more is in sight of where it can drive",
                     smallest(situation));
}

}  // namespace cairn::exploration
