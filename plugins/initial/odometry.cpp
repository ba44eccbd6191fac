// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "guesses.hpp"
#include "placing.hpp"

namespace cairn::initial {
namespace {

/// Whether a variable is one of a chain: a pose, not a landmark. Types that say nothing of where
/// they are in space are taken for poses if a relative factor joins them.
std::vector<bool> chain_types(const Graph& graph) {
  std::vector<bool> chain(graph.variable_pools().size(), false);
  for (std::size_t p = 0; p < chain.size(); ++p) {
    chain[p] = has_orientation(*graph.variable_pools()[p].type);
  }
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.type->is_relative()) chain[pool.variable_pools[0]] = true;
  }
  return chain;
}

/// Dead reckoning: poses in the order of their ids, each from the one before it.
class Odometry final : public InitialGuess {
 public:
  std::vector<std::string> compute(Graph& graph) override {
    Placing placing(graph);
    placing.place_roots(resolve_gauge(graph));
    std::int64_t jumps = 0;
    int first_jump = -1;
    const std::vector<bool> is_chain = chain_types(graph);
    for (std::size_t pool = 0; pool < is_chain.size(); ++pool) {
      if (!is_chain[pool]) continue;
      const GrowingArray<std::int32_t>& variables = graph.variable_pools()[pool].variables;
      std::vector<int> chain(variables.begin(), variables.end());
      std::sort(chain.begin(), chain.end(),
                [&](int a, int b) { return graph.id(a) < graph.id(b); });
      // Forward from the first pose that is known; those before it, backward.
      follow(graph, placing, chain, jumps, first_jump);
      std::reverse(chain.begin(), chain.end());
      follow(graph, placing, chain, jumps, first_jump);
    }
    std::vector<std::string> notes;
    if (jumps > 0) {
      notes.push_back(counted(jumps, "pose has", "poses have") +
                      " no factor to the pose before it and came from another placed one (first: " +
                      graph.describe_variable(first_jump) + ")");
    }
    place_landmarks(graph, placing, is_chain);
    placing.spread();  // what the chain did not reach
    placing.finish(notes);
    return notes;
  }

 private:
  static void follow(const Graph& graph, Placing& placing, const std::vector<int>& chain,
                     std::int64_t& jumps, int& first_jump) {
    for (std::size_t k = 0; k < chain.size(); ++k) {
      if (placing.placed(chain[k])) continue;
      if (k > 0 && place_from(graph, placing, chain[k], chain[k - 1])) continue;
      if (place_from_any(placing, chain[k]) && jumps++ == 0) first_jump = chain[k];
    }
  }

  static bool place_from(const Graph& graph, Placing& placing, int variable, int predecessor) {
    if (!placing.placed(predecessor)) return false;
    for (int f : placing.factors()[variable]) {
      const auto variables = graph.factor_variables(f);
      if (variables.size() != 2) continue;
      if (variables[0] != predecessor && variables[1] != predecessor) continue;
      if (placing.place(variable, f)) return true;
    }
    return false;
  }

  static bool place_from_any(Placing& placing, int variable) {
    const auto factors = placing.factors()[variable];
    return std::any_of(factors.begin(), factors.end(),
                       [&](int f) { return placing.place(variable, f); });
  }

  /// From the first pose that saw it.
  static void place_landmarks(const Graph& graph, Placing& placing,
                              const std::vector<bool>& is_chain) {
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (!placing.placed(v) && !is_chain[graph.pool(v)]) place_from_any(placing, v);
    }
  }
};

}  // namespace

std::unique_ptr<InitialGuess> make_odometry() { return std::make_unique<Odometry>(); }

}  // namespace cairn::initial
