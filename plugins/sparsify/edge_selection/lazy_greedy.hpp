// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "cairn/sparsification/edge_selection.hpp"

namespace cairn::edges {

/// A set function of which the greedy algorithm needs what one more element adds.
struct Increments {
  std::function<double(int k)> gain;  ///< of adding k to what has been added
  std::function<void(int k)> add;
};

/// `count` of the numbers 0 … size − 1, in the order in which the greedy algorithm takes them:
/// always one with the largest gain. Gains must not grow while elements are added (the function is
/// submodular): then one that was computed before is a bound, and only those at the head of the
/// queue are computed again (Minoux 1978). Of a function that is monotone, too, the value is at
/// least 1 − 1/e of the best (Nemhauser, Wolsey and Fisher 1978). None if `step` ends it.
std::optional<std::vector<int>> lazy_greedy(int size, int count, const Increments& function,
                                            const EdgeSelection::Step& step);

}  // namespace cairn::edges
