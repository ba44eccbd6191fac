// SPDX-License-Identifier: BSD-3-Clause
#include "end_notes.hpp"

#include <fmt/core.h>

namespace cairn {
namespace {

/// Where no scan is matched the map bends as odometry drifts, and nothing else shows that.
std::string odometry_alone(const RunFacts& facts) {
  constexpr double kFar = 20.0;  // [m]
  if (facts.longest_unmatched < kFar) return {};
  return fmt::format(
      "it drove {:.0f} m by odometry alone, without a scan that was matched with another one: "
      "there the map may be bent{}",
      facts.longest_unmatched, facts.match_consecutive ? "" : "; scans in a row are not matched");
}

/// Drift within what the covariances say bends the map as well.
std::string uncertain(const ExplorationResult& result, const RunFacts& facts) {
  constexpr double kMuch = 0.2;  // [m]
  if (!(result.expected_ate > kMuch)) return {};
  return fmt::format(
      "the positions are uncertain, by their covariances {:.2g} m (root mean square), after {} "
      "loop closure{}: the map may be bent{}",
      result.expected_ate, result.slam.loops, result.slam.loops == 1 ? "" : "s",
      facts.recorded ? ""
                     : "; a run that returns to places it has seen closes more (explorer "
                       "errt_star, or a larger `range` of the policy and the sensor)");
}

/// Where the registration refuses nearly all pairs, and has matched few scans, the map rests on
/// odometry.
std::string refused_matches(const ExplorationResult& result) {
  constexpr int kEnoughToTell = 50;
  constexpr double kFew = 0.15, kFewOfScans = 0.1;
  const ScanSlamCounts& counts = result.slam;
  if (counts.proposed < kEnoughToTell || counts.registered >= kFew * counts.proposed ||
      counts.registered + counts.consecutive >=
          kFewOfScans * static_cast<double>(result.steps.size()))
    return {};
  return fmt::format(
      "of {} pairs of scans that were to be matched, the registration has refused {}: the map "
      "rests mostly on odometry; its options say how noisy scans may be and how far apart",
      counts.proposed, counts.proposed - counts.registered);
}

/// What an explorer takes for all that can be reached may be less, as a simulation knows.
std::string unfinished(const ExplorationResult& result, const RunFacts& facts) {
  constexpr double kNearlyAll = 0.95;
  if (result.end != ExplorationEnd::finished || facts.recorded || !result.against) return {};
  const double seen = result.against->reachable_seen.value_or(1.0);
  if (seen >= kNearlyAll) return {};
  return fmt::format(
      "nothing was left that it could reach, but it has seen {:.0f} % of what its body could "
      "cover; "
      "smaller cells of the map, such as log_odds:resolution=0.05, leave narrow gaps open",
      100.0 * seen);
}

std::string not_driven(const RunFacts& facts) {
  if (facts.not_driven == 0) return {};
  return fmt::format(
      "{} times no curve with a turning radius of {:g} m led to where it was to go: it went "
      "elsewhere, or back the way it came",
      facts.not_driven, facts.turning_radius);
}

}  // namespace

std::vector<std::string> notes_of_end(const ExplorationResult& result, const RunFacts& facts) {
  std::vector<std::string> notes{not_driven(facts)};
  notes.insert(notes.end(), result.slam.notes.begin(), result.slam.notes.end());
  for (const std::string& note : {odometry_alone(facts), uncertain(result, facts),
                                  refused_matches(result), unfinished(result, facts)})
    notes.push_back(note);
  std::erase_if(notes, [](const std::string& note) { return note.empty(); });
  return notes;
}

}  // namespace cairn
