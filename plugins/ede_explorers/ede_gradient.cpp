// SPDX-License-Identifier: BSD-3-Clause
#include "ede_gradient.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

/// Weights of obstacles that are tried in turn.
constexpr std::array kWeights{1.0, 1.1, 1.25, 1.5, 2.0, 3.0};
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

PlannedPath path_along(const Situation& situation, const ConfigurationSpace& space,
                       const PotentialField::Descent& descent) {
  PlannedPath path;
  path.points = straightened(space, descent.path);
  if (path.points.front() != situation.pose.translation())
    path.points.insert(path.points.begin(), situation.pose.translation());
  for (std::size_t k = 1; k < path.points.size(); ++k)
    path.length += (path.points[k] - path.points[k - 1]).norm();
  const double heading = descent.path.back().theta();
  path.look_at = path.points.back() + Vector2d(std::cos(heading), std::sin(heading));
  return path;
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
  if (fallback_) fallback_->begin(seed);
}

Decision EdeGradient::decide(const Situation& situation) {
  falls_back_ = false;
  ++decisions_;
  for (const bool tight : {false, true}) {
    for (int round = 0; round < kMostRounds; ++round) {
      const ReachableField at = goals_.field(situation, tight);
      if (!at.discovers || !at.field->best(at.reachable)) break;
      std::optional<Decision> decision = descend(situation, at);
      if (!decision) return stuck(situation);
      const PlannedPath& path = decision->candidates.front().path;
      const Vector2d ahead = *path.look_at - path.points.back();
      const Pose2 end(path.points.back().x(), path.points.back().y(),
                      std::atan2(ahead.y(), ahead.x()));
      const auto configuration = at.field->space().nearest(end);
      if (!configuration) return stuck(situation);
      if (!moves(situation, path)) {
        goals_.give_up(situation, at, *configuration);
        continue;
      }
      goals_.chosen(at, *configuration);
      return std::move(*decision);
    }
  }
  return end_decision(Decision::Kind::finished, goals_.end_text(situation));
}

/// None: no weight leads to an attractor.
std::optional<Decision> EdeGradient::descend(const Situation& situation, const ReachableField& at) {
  const ConfigurationSpace& space = at.field->space();
  PotentialField potential(space, decrease_of(at), options_.potential);
  const Pose2 start = start_of(situation, at);
  for (const double weight : kWeights) {
    if (weight < options_.weight) continue;
    const PotentialField::Solution solution = potential.solve(weight);
    const PotentialField::Descent descent = potential.descend(start);
    if (descent.end != PotentialField::End::minimum) continue;
    const auto configuration = space.nearest(descent.path.back());
    Decision decision;
    decision.candidates.push_back(
        {.path = path_along(situation, space, descent),
         .value = at.field->value(*configuration),
         .what = fmt::format("a minimum with {:.0f} frontier cells in sight",
                             at.field->seen(*configuration)),
         .change = at.field->change(*configuration)});
    const Candidate& chosen = decision.candidates.front();
    decision.why = fmt::format("to {}, {:.1f} m away, with E = {:.3g} nats, weight {:g}",
                               chosen.what, chosen.path.length, chosen.value, weight);
    if (!solution.converged) {
      decision.notes.push_back(
          fmt::format("the potential did not stand after {} sweeps", solution.sweeps));
    }
    return decision;
  }
  return std::nullopt;
}

Decision EdeGradient::stuck(const Situation& situation) {
  ++stuck_;
  const std::string count =
      fmt::format("the gradient leads nowhere ({} of {} decisions)", stuck_, decisions_);
  if (!fallback_) return end_decision(Decision::Kind::stuck, count);
  falls_back_ = true;
  Decision decision = fallback_->decide(situation);
  decision.why = fmt::format("{}; fallback: {}", count, decision.why);
  return decision;
}

bool EdeGradient::is_worthwhile(const Situation& situation, const PlannedPath& path) {
  return falls_back_ ? fallback_->is_worthwhile(situation, path) : goals_.is_worthwhile(situation);
}

}  // namespace cairn::exploration
