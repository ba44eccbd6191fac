// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>

#include "topologies.hpp"

namespace cairn::sparsify {

std::vector<FactorChoice> MixedParts::choose(const DenseBlanket& blanket, int population) {
  const std::vector<FactorChoice> tree = ChowLiuTree(options_).choose(blanket, population);
  const std::vector<FactorModel>& models = blanket.models;
  std::map<std::vector<int>, int> whole;  // by nodes the first model, which is of all rows
  for (int k = 0; k < static_cast<int>(std::ssize(models)); ++k) whole.emplace(models[k].nodes, k);
  // Two models of the same nodes with more rows than the whole have some in common.
  const auto excludes = [&](int a, int b) {
    return models[a].nodes == models[b].nodes &&
           models[a].size + models[b].size > models[whole.at(models[a].nodes)].size;
  };
  std::vector<Candidate> candidates;
  for (int k = 0; k < static_cast<int>(std::ssize(models)); ++k) {
    if (std::ranges::none_of(
            tree, [&](const FactorChoice& choice) { return excludes(choice.front(), k); }))
      candidates.push_back({k, models[k].size});
  }
  const int rows = blanket.node_sizes.front();
  const int budget = rows * std::max(0, population - static_cast<int>(std::ssize(tree)));
  std::vector<FactorChoice> chosen = grow(blanket, tree, candidates, budget, excludes);
  // All parts of one measurement are the whole.
  std::map<std::vector<int>, int> parts;
  for (const FactorChoice& choice : chosen) ++parts[models[choice.front()].nodes];
  std::vector<FactorChoice> merged;
  for (const FactorChoice& choice : chosen) {
    const std::vector<int>& nodes = models[choice.front()].nodes;
    if (parts.at(nodes) == 1) {
      merged.push_back(choice);
    } else if (parts.at(nodes) > 1) {
      merged.push_back({whole.at(nodes)});
      parts.at(nodes) = 0;
    }
  }
  return merged;
}

}  // namespace cairn::sparsify
