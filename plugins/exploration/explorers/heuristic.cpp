// SPDX-License-Identifier: BSD-3-Clause
#include "heuristic.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "cairn/planning/loop_closure_value.hpp"

namespace cairn::exploration {
namespace {

/// The known floor must grow by this factor to be a discovery.
constexpr double kDiscovery = 1.002;
/// Poses that are tried for a revisit, the most informative first, until there is a path to one.
constexpr std::size_t kMostTries = 50;

/// Whether there is a path, and it is more than a turn on the spot: a row of those would never come
/// to a limit of the distance.
bool drives(const std::optional<PlannedPath>& path, const RobotModel& robot) {
  return path && path->length >= robot.step;
}

/// "a frontier of 3.2 m, −4.1"
std::string listed(const Candidate& candidate) {
  return fmt::format("{} {:+.3g}", candidate.what, candidate.value);
}

}  // namespace

void Heuristic::begin(std::uint64_t seed) {
  FrontierExplorer::begin(seed);
  revisits_now_ = false;
  revisits_ = 0;
  coverage_ = 0.0;
}

void Heuristic::choose(const Situation& situation, Decision& decision) {
  if (situation.map.coverage() > kDiscovery * coverage_) {
    coverage_ = situation.map.coverage();
    revisits_ = 0;
  }
  std::vector<Candidate>& candidates = decision.candidates;
  std::ranges::stable_sort(candidates, {}, &Candidate::value);
  if (candidates.size() > static_cast<std::size_t>(options_.frontiers))
    candidates.resize(static_cast<std::size_t>(options_.frontiers));
  const std::size_t frontiers = candidates.size();
  if (options_.revisits == 0 || revisits_ < options_.revisits) {
    if (auto candidate = revisit(situation)) candidates.push_back(std::move(*candidate));
    if (auto candidate = home(situation)) candidates.push_back(std::move(*candidate));
  }
  const PathSimulation simulation(situation, options_.simulation, registry_);
  std::vector<std::size_t> loops;
  for (Candidate& candidate : candidates) {
    if (situation.interrupted()) return;
    const SimulatedDrive drive = simulation.drive(candidate.path);
    candidate.value = drive.value();
    candidate.change = drive.change;
    loops.push_back(drive.closures.size());
  }
  const auto best = std::ranges::min_element(candidates, {}, &Candidate::value);
  decision.chosen = static_cast<std::size_t>(best - candidates.begin());
  revisits_now_ = decision.chosen >= frontiers;
  if (revisits_now_) ++revisits_;
  std::string others;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    if (k == decision.chosen) continue;
    others += (others.empty() ? "; less than " : ", ") + listed(candidates[k]);
  }
  decision.why = fmt::format(
      "to {}, {:.1f} m away, {:+.3g}: trajectory {:+.2g} nats by {} loop closure{}, "
      "map {:+.3g} nats·m²{}",
      best->what, best->path.length, best->value, best->change->trajectory, loops[decision.chosen],
      loops[decision.chosen] == 1 ? "" : "s", best->change->map, others);
}

/// A path to the pose, of those that can be reached, whose loop closure has the most information.
std::optional<Candidate> Heuristic::revisit(const Situation& situation) {
  std::vector<LoopClosureValue> values =
      loop_closure_values(situation, options_.simulation.entropy);
  std::ranges::stable_sort(values, {}, &LoopClosureValue::change);
  if (values.size() > kMostTries) values.resize(kMostTries);
  // The thesis's form of the entropy is twice that in which information gains are.
  const double form = options_.simulation.entropy == EntropyForm::thesis ? 2.0 : 1.0;
  const double least = form * situation.match.loop_gain_unless(options_.simulation.loop_gain);
  for (const LoopClosureValue& value : values) {
    if (!(-value.change > least) || situation.interrupted()) break;
    std::optional<PlannedPath> path = goals().path_to(value.pose);
    if (!drives(path, situation.robot)) continue;
    return Candidate{.path = std::move(*path),
                     .what = fmt::format("pose {}, with a loop closure of {:.1f} nats", value.id,
                                         -value.change)};
  }
  return std::nullopt;
}

std::optional<Candidate> Heuristic::home(const Situation& situation) {
  if (!options_.homing) return std::nullopt;
  const Pose2 first = Pose2::from_state(situation.estimator.state(situation.poses.front()));
  std::optional<PlannedPath> path = goals().path_to(first);
  if (!drives(path, situation.robot)) return std::nullopt;
  return Candidate{.path = std::move(*path), .what = "the first pose"};
}

bool Heuristic::is_worthwhile(const Situation& situation, const PlannedPath& path) {
  return revisits_now_ || FrontierExplorer::is_worthwhile(situation, path);
}

}  // namespace cairn::exploration
