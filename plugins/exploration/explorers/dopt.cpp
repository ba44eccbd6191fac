// SPDX-License-Identifier: BSD-3-Clause
#include "dopt.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "cairn/planning/path_motions.hpp"

namespace cairn::exploration {

Dopt::Dopt(const DoptOptions& options, Registry& registry)
    : FrontierExplorer(options.frontier, registry),
      options_(options),
      solver_(registry.make<LinearSolver>(parse_component(options.solver))) {}

void Dopt::choose(const Situation& situation, Decision& decision) {
  std::vector<Candidate>& candidates = decision.candidates;
  // Nearest first: of equal ones the first is chosen.
  std::ranges::stable_sort(candidates, {}, &Candidate::value);
  PathOptimalities optimalities(situation, options_.optimality, *solver_);
  std::vector<int> loops;
  for (Candidate& candidate : candidates) {
    if (situation.interrupted()) return;
    const PathOptimality path =
        optimalities.along(motions_along(situation.pose, candidate.path, situation.robot));
    candidate.value = optimalities.now().log_optimality - path.log_optimality;
    loops.push_back(path.loops);
  }
  const double least = std::ranges::min_element(candidates, {}, &Candidate::value)->value;
  const auto chosen = std::ranges::find_if(candidates, [&](const Candidate& candidate) {
    return candidate.value <= least + options_.margin;
  });
  const double most = std::ranges::max_element(candidates, {}, &Candidate::value)->value;
  decision.chosen = static_cast<std::size_t>(chosen - candidates.begin());
  decision.why = fmt::format(
      "to {}, {:.1f} m away, by which D-optimality ({}) becomes {:.4f} times what it is, with {} "
      "loop closure{}; of {} frontiers, for which it is {:.4f} to {:.4f} times",
      chosen->what, chosen->path.length, to_string(options_.optimality.by),
      std::exp(-chosen->value), loops[decision.chosen], loops[decision.chosen] == 1 ? "" : "s",
      candidates.size(), std::exp(-most), std::exp(-least));
}

}  // namespace cairn::exploration
