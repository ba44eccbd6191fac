// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn::initial {

/// More are not searched.
inline constexpr int kMostVariables = 5000;

/// A start by its name, such as "spanning_tree".
struct NamedStart {
  std::string name;
  std::function<void(Graph&)> compute;  ///< may throw `Error` (input, numerical): left out
  double iterations = 0.0;              ///< which it takes itself
};

/// What a search for lower minima has found.
struct OtherMinima {
  int starts = 0;              ///< that were optimised
  int elsewhere = 0;           ///< of these, those that ended in another minimum, by chi2
  double before = 0.0;         ///< chi2 of the minimum given
  double chi2 = 0.0;           ///< of the lowest one found, whose states the graph has
  std::string found_by;        ///< the start that led there; empty: the one given is the lowest
  bool until_the_end = false;  ///< lower ones were found until the search ended
};

/// Looks for a lower minimum of chi2 than that in which a graph is, by optimising other starts:
/// `starts`, and what changes the best minimum so far:
///   - estimates by a robust loss at the median of the residuals, which gives way where
///   measurements
///     contradict each other,
///   - the trajectory with further full turns along its way: headings are known up to these,
///   - a fifth of the factors, at random, almost left out.
/// It ends early where the first of these all lead back. `wanted`: whether to go on, asked between
/// the starts and in each iteration. The time is bounded by a number of iterations that falls with
/// the size of the graph; none are left for more than
/// `kMostVariables`.
OtherMinima search_other_minima(Graph& graph, const std::vector<NamedStart>& starts,
                                Optimizer& optimizer, const std::function<bool(double)>& wanted);

/// The largest angle by which the poses of a relative measurement disagree with it [rad].
double largest_turn(const Graph& graph);

}  // namespace cairn::initial
