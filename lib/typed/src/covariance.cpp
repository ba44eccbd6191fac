// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/covariance.hpp"

#include <algorithm>

#include <fmt/core.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/linear/linear_solver.hpp"

namespace cairn::detail {

std::vector<double> covariance_blocks(const Graph& graph, std::span<const std::pair<Id, Id>> pairs,
                                      std::string_view linear_solver, Registry& registry) {
  std::vector<std::pair<int, int>> wanted;
  for (const auto& [a, b] : pairs) wanted.emplace_back(index_of(graph, a), index_of(graph, b));
  for (const int v : resolve_gauge(graph).unconstrained) {
    const auto is_wanted = [&](const auto& pair) { return pair.first == v || pair.second == v; };
    if (graph.fixed(v) || std::ranges::none_of(wanted, is_wanted)) continue;
    throw Error(ErrorCode::numerical, fmt::format("there is no covariance of {}: it has no factor",
                                                  graph.describe_variable(v)));
  }
  const auto solver = registry.make<LinearSolver>(linear_solver);
  GraphMarginals marginals(graph, *solver);
  if (const Factorization factorization = marginals.factorize(); !factorization.ok) {
    throw Error(ErrorCode::numerical,
                "there are no covariances: " + marginals.explain(factorization));
  }
  return marginals.blocks(wanted);
}

}  // namespace cairn::detail
