// SPDX-License-Identifier: BSD-3-Clause
#include "ede_rrt_star.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

/// Candidates are at least so far apart, and a path may end so far from its goal [m].
constexpr double kSpacing = 1.0, kTolerance = 0.5;
/// Part of the time budget for fields.
constexpr double kFieldPart = 0.4;
/// And the least that the fallback has.
constexpr double kLeastPart = 0.2;
/// How often a goal at which the robot is already is given up in one decision.
constexpr int kMostRounds = 20;

std::string name_of(const EntropyField& field, std::size_t configuration) {
  const InformationChange change = field.change(configuration);
  return fmt::format("{:.0f} frontier cells in sight, {:.2f} nats by a loop closure",
                     field.seen(configuration), -change.trajectory);
}

}  // namespace

EdeRrtStar::EdeRrtStar(const EdeRrtStarOptions& options, Registry& registry)
    : options_(options),
      goals_(options.goals),
      planner_(registry.make<PathPlanner>(parse_component(options.planner))) {
  const ComponentSpec fallback = parse_component(options.fallback);
  if (fallback.name == "ede_rrt_star")
    throw Error(ErrorCode::usage, "ede_rrt_star: the fallback has to be another explorer");
  if (fallback.name != "none") fallback_ = registry.make<Explorer>(fallback);
}

void EdeRrtStar::begin(std::uint64_t seed) {
  goals_.begin();
  falls_back_ = false;
  if (fallback_) fallback_->begin(seed);
}

Decision EdeRrtStar::decide(const Situation& situation) {
  const DecisionTime time(situation.budget);
  Decision decision;
  falls_back_ = false;
  for (const bool tight : {false, true})
    if (drive(situation, tight, time, decision) || situation.interrupted()) return decision;
  if (fallback_) {
    falls_back_ = true;
    const double least = kLeastPart * situation.budget;
    decision = fallback_->decide(adapted(situation, situation.robot, std::max(time.left(), least)));
    decision.notes.push_back("no configuration was worth driving to: the fallback went on");
    return decision;
  }
  return end_decision(Decision::Kind::finished, goals_.end_text(situation));
}

bool EdeRrtStar::is_worthwhile(const Situation& situation, const PlannedPath& path) {
  return falls_back_ ? fallback_->is_worthwhile(situation, path) : goals_.is_worthwhile(situation);
}

/// False: there is no goal with a path.
bool EdeRrtStar::drive(const Situation& situation, bool tight, const DecisionTime& time,
                       Decision& decision) {
  bool started = false;
  for (int round = 0; round < kMostRounds && !situation.interrupted(); ++round) {
    const double before = time.passed();
    const ReachableField at = goals_.field(situation, tight, time.left(kFieldPart));
    if (!at.discovers) return false;
    const std::vector<Goal> goals = best_goals(situation, at);
    if (goals.empty()) return false;
    if (!std::exchange(started, true)) {
      const RobotModel robot =
          tight ? narrowed(situation.robot, situation.map.frame) : situation.robot;
      planner_->start(situation.map, situation.pose.translation(), robot.radius);
    }
    decision.candidates.clear();
    std::optional<std::size_t> there;  // the robot stands at this goal
    std::vector<std::size_t> configurations;
    for (const Goal& goal : goals) {
      if (situation.interrupted()) break;
      std::optional<PlannedPath> path = path_to(at, goal.configuration);
      if (!path) continue;
      if (tight) path->radius = narrowed(situation.robot, situation.map.frame).radius;
      if (!moves(situation, *path)) {
        if (decision.candidates.empty()) there = goal.configuration;
        continue;
      }
      decision.candidates.push_back({.path = std::move(*path),
                                     .value = goal.value,
                                     .what = name_of(*at.field, goal.configuration),
                                     .change = at.field->change(goal.configuration)});
      configurations.push_back(goal.configuration);
    }
    if (there) {
      goals_.give_up(situation, at, *there);
      // Another field would take as long; the next best goals of this one are known.
      const bool is_late = time.left() < time.passed() - before;
      if (!is_late || decision.candidates.empty()) continue;
      decision.notes.emplace_back(
          "where the time budget left none for another field, the next best goal was taken");
    }
    if (decision.candidates.empty()) return false;
    if (at.coarse) decision.notes.emplace_back(kCoarseNote);
    decision.chosen = 0;  // the best comes first
    const Candidate& chosen = decision.candidates.front();
    goals_.chosen(at, configurations.front());
    decision.why =
        fmt::format("to {}, {:.1f} m away, with E = {:.3g} nats{}", chosen.what, chosen.path.length,
                    at.field->value(configurations.front()), tight ? ", through tight gaps" : "");
    return true;
  }
  return false;
}

/// The least values, best first, not too near to each other.
std::vector<EdeRrtStar::Goal> EdeRrtStar::best_goals(const Situation& situation,
                                                     const ReachableField& at) const {
  const ConfigurationSpace& space = at.field->space();
  const std::size_t layer = space.cells().size();
  std::vector<Goal> best(layer);  // of all orientations in a cell
  for (std::size_t k = 0, n = 0; k < space.size(); ++k) {
    const double value = at.field->value(k);
    if (at.reachable[n] != 0 && value < best[n].value) best[n] = {k, value};
    if (++n == layer) n = 0;
  }
  if (options_.per_metre) {
    for (std::size_t n = 0; n < layer; ++n)
      best[n].value /= std::max<double>(at.lengths[n], situation.robot.step);
  }
  std::vector<Goal> goals;
  for (int k = 0; k < options_.candidates; ++k) {
    const auto least = std::ranges::min_element(best, {}, &Goal::value);
    if (least == best.end() || !(least->value < 0.0)) break;
    goals.push_back(*least);
    const Vector2d middle = space.position(space.number_of(goals.back().configuration));
    for (std::size_t n = 0; n < layer; ++n) {
      if ((space.position(static_cast<std::int32_t>(n)) - middle).norm() < kSpacing)
        best[n].value = 0.0;
    }
  }
  return goals;
}

/// A path at whose end the robot has the orientation of the configuration.
std::optional<PlannedPath> EdeRrtStar::path_to(const ReachableField& at,
                                               std::size_t configuration) {
  const Pose2 goal = at.field->space().pose(configuration);
  std::optional<PlannedPath> path = planner_->path_to(goal.translation(), kTolerance);
  if (!path) return path;
  const Vector2d end = path->points.empty() ? goal.translation() : path->points.back();
  path->look_at = end + Vector2d(std::cos(goal.theta()), std::sin(goal.theta()));
  return path;
}

}  // namespace cairn::exploration
