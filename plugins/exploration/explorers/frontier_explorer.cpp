// SPDX-License-Identifier: BSD-3-Clause
#include "frontier_explorer.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace cairn::exploration {
namespace {

/// The middle of a frontier moves by less while it is seen better [m].
constexpr double kSameGoal = 1.0;

/// Radii of the body: a frontier that is longer and cannot be reached is more than what remains
/// behind ragged walls where all has been seen, which is at most 14.
constexpr double kMuch = 20.0;

/// The sentence with which a run without any frontier left ends.
std::string end_text(const FrontierGoals& goals, double smallest) {
  if (goals.unreachable() == 0)
    return fmt::format("no frontier of {:g} m or more is left", smallest);
  return fmt::format(
      "no frontier of {:g} m or more is left that can be reached; {} without a path or tried in "
      "vain, the longest {:.1f} m",
      smallest, goals.unreachable(), goals.longest_unreachable());
}

}  // namespace

FrontierExplorer::FrontierExplorer(const FrontierOptions& options, Registry& registry)
    : options_(options), goals_(registry.make<PathPlanner>(options.planner)) {}

void FrontierExplorer::begin(std::uint64_t) {
  goals_.begin();
  goal_.reset();
}

Decision FrontierExplorer::decide(const Situation& situation) {
  Decision decision;
  const double smallest =
      options_.smallest > 0.0 ? options_.smallest : 2.0 * situation.robot.radius;
  double least = 0.0;
  goals_.start(situation);
  for (const bool tight : {false, true}) {
    if (tight && !goals_.start_through_gaps()) break;
    for (least = std::max(options_.length, smallest);; least = std::max(0.5 * least, smallest)) {
      decision.candidates = goals_.candidates(least);
      if (!decision.candidates.empty() || least <= smallest) break;
    }
    if (!decision.candidates.empty()) break;
  }
  if (decision.candidates.empty()) {
    if (std::optional<PlannedPath> turn = goals_.look_around()) {
      decision.candidates.push_back({std::move(*turn), 0.0, "what is around it"});
      decision.why =
          fmt::format("none of {} frontiers can be reached: it looks around", goals_.unreachable());
      return decision;
    }
    const bool much_is_left = goals_.longest_unreachable() > kMuch * situation.robot.radius;
    decision.kind = much_is_left ? Decision::Kind::stuck : Decision::Kind::finished;
    decision.why = end_text(goals_, smallest);
    if (much_is_left) {
      decision.why +=
          "; smaller cells of the map, such as log_odds:resolution=0.05, leave narrow gaps open";
    }
    return decision;
  }
  for (Candidate& candidate : decision.candidates) {
    if (goal_ && (*candidate.path.look_at - *goal_).norm() < kSameGoal)
      candidate.value *= options_.keep;
  }
  const std::size_t frontiers = decision.candidates.size();
  choose(situation, decision);
  const Candidate& chosen = decision.candidates[decision.chosen];
  goal_ = chosen.path.look_at;
  if (chose_frontier()) goals_.chosen(chosen.path);
  if (decision.why.empty())
    decision.why = fmt::format("to {}, {:.1f} m away, of {} of at least {:.2g} m", chosen.what,
                               chosen.path.length, frontiers, least);
  return decision;
}

bool FrontierExplorer::is_worthwhile(const Situation& situation, const PlannedPath& path) {
  return !path.look_at || FrontierGoals::is_there(situation.map, *path.look_at);
}

}  // namespace cairn::exploration
