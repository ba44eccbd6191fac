// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// By position, the weight ρ′ that each factor's loss leaves it at the graph's states; 1 without
/// one.
CAIRN_API std::vector<double> loss_weights(const Graph& graph);

/// How many factors robust losses have all but taken from an estimate: whose weight ρ′ at the
/// graph's states is below one per cent.
struct RejectedFactors {
  std::int64_t loops = 0, rejected_loops = 0;    ///< loop closures with a loss; those of them
  std::int64_t others = 0, rejected_others = 0;  ///< other factors with a loss; those of them
  std::vector<int> positions = {};               ///< of all that are rejected, rising
  /// Nearly all loop closures (nine in ten or more, three at least): what is left is dead
  /// reckoning, and contradicts nothing.
  bool nearly_all_loops() const { return rejected_loops >= 3 && 10 * rejected_loops >= 9 * loops; }
};
CAIRN_API RejectedFactors rejected_factors(const Graph& graph);

/// "the loss leaves 3 of 120 loop closures less than 1 % of their weight", with what that means
/// where they are nearly all; empty where no factor is rejected.
CAIRN_API std::string in_words(const RejectedFactors& rejected);

/// Adds that sentence to what an update reports: as a doubt where they are nearly all.
CAIRN_API void note_rejected(const Graph& graph, UpdateReport& report);

}  // namespace cairn
