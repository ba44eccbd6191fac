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

/// A graph of up to 400 variables is searched on smaller signs, and to the end: its poses disagree
/// with a measurement by more than this [rad].
inline constexpr int kFewVariables = 400;
inline constexpr double kTurnOfFew = 0.2;

/// From one start two optimizers may end in different minima; null where there is no other.
struct SearchOptimizers {
  Optimizer* one = nullptr;
  Optimizer* other = nullptr;
};

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
  int in_the_lowest = 0;       ///< starts that ended in the lowest minimum
  int nearly_as_low = 0;       ///< minima within 5 % of its chi2 in which starts ended

  /// A lower one was found, five minima or more are nearly as low, and fewer than half of the
  /// starts end in the lowest: where so many are met, there are others that are not, and one of
  /// them may be lower.
  bool many_nearly_as_low() const {
    return !found_by.empty() && nearly_as_low >= 5 && 2 * in_the_lowest < starts;
  }
};

/// Looks for a lower minimum of chi2 than that in which a graph is, by optimising other starts:
/// `starts`, and what changes the best minimum so far:
///   - estimates by a robust loss at the median of the residuals, which gives way where
///     measurements contradict each other,
///   - the trajectory with further full turns along its way, or a part of it: headings are known
///     up to these,
///   - a fifth of the factors, or half of the loop closures, at random, almost left out,
///   - factors that losses reject with their full weight,
///
/// and by the other optimizer, if there is one, each of the starts that cost nothing and every
/// second four at random.
/// It ends where the first of these all lead back and losses reject nothing (not in a small graph
/// whose poses disagree with a measurement, `kTurnOfFew`, or whose losses leave a factor less than
/// a quarter of its weight), and where 32 starts at random, 64 in a small graph,
/// lead to nothing lower. A start under bounded losses is optimised by losses that are tightened to
/// them. `wanted`: whether to go on, asked between the starts and in each iteration. The time is
/// bounded by a number of iterations that falls with the size of the graph; none are left for more
/// than `kMostVariables`.
OtherMinima search_other_minima(Graph& graph, const std::vector<NamedStart>& starts,
                                const SearchOptimizers& optimizers,
                                const std::function<bool(double)>& wanted);

/// The largest angle by which the poses of a relative measurement disagree with it [rad].
double largest_turn(const Graph& graph);

/// The largest angle [rad] by which a pose is turned from where the relative measurements that join
/// each pose to the nearest one before it, such as odometry, lead from the first. Infinite where a
/// variable is joined to none before it, or is no pose.
double largest_drift(const Graph& graph);

/// Whether the graph has few variables, and `angle`, its largest turn, is large for that.
bool few_that_disagree(const Graph& graph, double angle);

}  // namespace cairn::initial
