// SPDX-License-Identifier: BSD-3-Clause
#include "ede_gradient.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "shortest_path.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

/// Weights of obstacles that are tried in turn.
constexpr std::array kWeights{1.0, 1.1, 1.25, 1.5, 2.0, 3.0};
/// So far away a goal is that is chosen without a gradient [m].
constexpr double kAway = 1.0;
/// Part of the time budget for the field.
constexpr double kFieldPart = 0.4;
/// Part of the time budget within which potentials are solved, and that without which none is
/// begun: the first sweeps take about a quarter of it on a floor like Freiburg 079.
constexpr double kSolvePart = 0.7, kLeastPart = 0.25;
/// How often a minimum at which the robot is already is given up in one decision.
constexpr int kMostRounds = 10;

/// −E of what can be reached.
std::vector<float> decrease_of(const ReachableField& at) {
  const ConfigurationSpace& space = at.field->space();
  std::vector<float> decrease(space.size());
  const std::size_t layer = space.cells().size();
  for (std::size_t k = 0, n = 0; k < space.size(); ++k) {
    if (at.reachable[n] != 0) decrease[k] = static_cast<float>(-at.field->value(k));
    if (++n == layer) n = 0;
  }
  return decrease;
}

/// Where the descent begins: where the robot is, or the nearest place where its body fits.
Pose2 start_of(const Situation& situation, const ReachableField& at) {
  const ConfigurationSpace& space = at.field->space();
  if (space.nearest(situation.pose)) return situation.pose;
  const auto nearest = std::ranges::min_element(at.lengths);
  const Vector2d point = space.position(static_cast<std::int32_t>(nearest - at.lengths.begin()));
  return {point.x(), point.y(), situation.pose.theta()};
}

/// To the configuration with the least E by the shortest path, when the time for a decision is
/// over; none: there is none away from where the robot is.
std::optional<Decision> decide_at_once(const Situation& situation, const ReachableField& at) {
  const auto configuration = best_beyond(at, kAway);
  if (!configuration) return std::nullopt;
  Decision decision;
  decision.candidates.push_back(
      {.path = shortest_path(situation, at, *configuration),
       .value = at.field->value(*configuration),
       .what = fmt::format("the least E, with {:.0f} frontier cells in sight",
                           at.field->seen(*configuration)),
       .change = at.field->change(*configuration)});
  const Candidate& chosen = decision.candidates.front();
  decision.why = fmt::format("to {}, {:.1f} m away by the shortest path, with E = {:.3g} nats",
                             chosen.what, chosen.path.length, chosen.value);
  decision.notes.emplace_back(
      "where the time budget left none for a potential, or for all of them, the shortest path was "
      "driven");
  return decision;
}

/// The configuration at the end of the path that is chosen.
std::optional<std::size_t> end_of(const ReachableField& at, const Decision& decision) {
  const PlannedPath& path = decision.candidates.front().path;
  const Vector2d ahead = *path.look_at - path.points.back();
  return at.field->space().nearest(
      Pose2(path.points.back().x(), path.points.back().y(), std::atan2(ahead.y(), ahead.x())));
}

}  // namespace

EdeGradient::EdeGradient(const EdeGradientOptions& options, Registry& registry)
    : options_(options), goals_(options.goals) {
  const ComponentSpec fallback = parse_component(options.fallback);
  if (fallback.name == "ede_gradient")
    throw Error(ErrorCode::usage, "ede_gradient: the fallback has to be another explorer");
  if (fallback.name != "none") fallback_ = registry.make<Explorer>(fallback);
}

void EdeGradient::begin(std::uint64_t seed) {
  goals_.begin();
  falls_back_ = false;
  decisions_ = stuck_ = 0;
  too_many_ = std::numeric_limits<std::size_t>::max();
  if (fallback_) fallback_->begin(seed);
}

Decision EdeGradient::decide(const Situation& situation) {
  const DecisionTime time(situation.budget);
  falls_back_ = false;
  ++decisions_;
  for (const bool tight : {false, true}) {
    for (int round = 0; round < kMostRounds && !situation.interrupted(); ++round) {
      const double before = time.passed();
      // Once a potential was cut too short, it has fewer configurations.
      const bool too_many = too_many_ < std::numeric_limits<std::size_t>::max();
      const ReachableField at =
          goals_.field(situation, tight, too_many ? 0.0 : time.left(kFieldPart));
      if (!at.discovers || !at.field->best(at.reachable)) break;
      const double field_took = time.passed() - before;
      std::optional<Decision> decision = descend(situation, at, time);
      if (situation.interrupted()) return {};
      if (!decision && is_cut_) decision = decide_at_once(situation, at);
      if (!decision) return stuck(situation, time);
      if (!moves(situation, decision->candidates.front().path)) {
        const auto configuration = end_of(at, *decision);
        if (!configuration) return stuck(situation, time);
        goals_.give_up(situation, at, *configuration);
        if (time.left() >= field_took) continue;  // for another field
        decision = decide_at_once(situation, at);
        if (!decision || !moves(situation, decision->candidates.front().path)) continue;
      }
      const auto configuration = end_of(at, *decision);
      if (!configuration) return stuck(situation, time);
      goals_.chosen(at, *configuration);
      if (at.coarse) decision->notes.emplace_back(kCoarseNote);
      PlannedPath& path = decision->candidates.front().path;
      if (tight) path.radius = narrowed(situation.robot, situation.map.frame).radius;
      return std::move(*decision);
    }
  }
  return end_decision(Decision::Kind::finished, goals_.end_text(situation));
}

/// None: no weight leads to an attractor, of those for which there was time.
std::optional<Decision> EdeGradient::descend(const Situation& situation, const ReachableField& at,
                                             const DecisionTime& time) {
  const ConfigurationSpace& space = at.field->space();
  PotentialField potential(space, decrease_of(at), options_.potential);
  const Pose2 start = start_of(situation, at);
  is_cut_ = false;
  for (const double weight : kWeights) {
    if (weight < options_.weight) continue;
    const bool in_time = time.left(kSolvePart) >= kLeastPart * situation.budget;
    is_cut_ = !in_time || space.size() >= too_many_;
    if (is_cut_) break;
    const PotentialField::Solution solution =
        potential.solve(weight, time.left(kSolvePart), situation.interrupt);
    if (situation.interrupted()) return std::nullopt;
    const PotentialField::Descent descent = potential.descend(start);
    const bool cut = !solution.converged && solution.sweeps < options_.potential.sweeps;
    if (descent.end != PotentialField::End::minimum) {
      is_cut_ = cut;
      if (cut) {
        too_many_ = space.size();
        break;
      }
      continue;
    }
    const auto configuration = space.nearest(descent.path.back());
    Decision decision;
    decision.candidates.push_back(
        {.path = path_along(situation, space, descent.path),
         .value = at.field->value(*configuration),
         .what = fmt::format("a minimum with {:.0f} frontier cells in sight",
                             at.field->seen(*configuration)),
         .change = at.field->change(*configuration)});
    const Candidate& chosen = decision.candidates.front();
    decision.why = fmt::format("to {}, {:.1f} m away, with E = {:.3g} nats, weight {:g}",
                               chosen.what, chosen.path.length, chosen.value, weight);
    if (cut) {
      decision.notes.emplace_back("potentials were cut short by the time budget");
    } else if (!solution.converged) {
      decision.notes.push_back(
          fmt::format("the potential did not stand after {} sweeps", solution.sweeps));
    }
    return decision;
  }
  return std::nullopt;
}

Decision EdeGradient::stuck(const Situation& situation, const DecisionTime& time) {
  ++stuck_;
  const std::string count =
      fmt::format("the gradient leads nowhere ({} of {} decisions)", stuck_, decisions_);
  if (!fallback_) return end_decision(Decision::Kind::stuck, count);
  falls_back_ = true;
  const double least = kLeastPart * situation.budget;
  Decision decision =
      fallback_->decide(adapted(situation, situation.robot, std::max(time.left(), least)));
  decision.why = fmt::format("{}; fallback: {}", count, decision.why);
  return decision;
}

bool EdeGradient::is_worthwhile(const Situation& situation, const PlannedPath& path) {
  return falls_back_ ? fallback_->is_worthwhile(situation, path) : goals_.is_worthwhile(situation);
}

}  // namespace cairn::exploration
