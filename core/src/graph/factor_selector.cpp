// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/factor_selector.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "cairn/graph/graph.hpp"

namespace cairn {
namespace {

/// For each variable its place among the variables of its type, by rising id.
std::vector<std::int32_t> rank_within_type(const Graph& graph) {
  std::vector<std::int32_t> rank(graph.variable_count());
  for (const VariablePool& pool : graph.variable_pools()) {
    std::vector<std::int32_t> order(pool.variables.begin(), pool.variables.end());
    const auto by_id = [&](std::int32_t a, std::int32_t b) { return graph.id(a) < graph.id(b); };
    if (!std::ranges::is_sorted(order, by_id)) std::ranges::sort(order, by_id);
    for (std::size_t k = 0; k < order.size(); ++k) rank[order[k]] = static_cast<std::int32_t>(k);
  }
  return rank;
}

}  // namespace

FactorSelector FactorSelector::parse(std::string_view text) {
  if (text == "all") return all();
  if (text == "loops") return loops();
  return tag(std::string(text));
}

std::vector<bool> loop_closures(const Graph& graph) {
  const std::vector<std::int32_t> rank = rank_within_type(graph);
  std::vector<bool> result(graph.factor_count());
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto v = graph.factor_variables(f);
    result[f] = v.size() == 2 && graph.pool(v[0]) == graph.pool(v[1]) &&
                std::abs(rank[v[0]] - rank[v[1]]) != 1;
  }
  return result;
}

std::vector<bool> select(const Graph& graph, const FactorSelector& which) {
  if (which.kind() == FactorSelector::Kind::loops) return loop_closures(graph);
  std::vector<bool> result(graph.factor_count(), which.kind() == FactorSelector::Kind::all);
  if (which.kind() == FactorSelector::Kind::all) return result;
  for (int f = 0; f < graph.factor_count(); ++f) {
    result[f] = which.kind() == FactorSelector::Kind::tag
                    ? graph.factor_type(f).tag() == which.tag()
                    : which.predicate()(graph, f);
  }
  return result;
}

}  // namespace cairn
