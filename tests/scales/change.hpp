// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"

namespace cairn::scales {

/// The same problem in other numbers: the estimate is the same after the change is undone, and chi2
/// is multiplied by `information`.
struct Change {
  std::string name;
  double information = 1.0;           ///< all information matrices are multiplied by this
  double length = 1.0;                ///< a metre is written as so many units of length
  std::array<double, 3> offset = {};  ///< then added to all positions [units of length]

  /// The largest number that is added to a position.
  double largest_offset() const;
};

/// The table's rows: scales of the information from 1e-30 to 1e60, units of length from
/// nanometres to gigametres, and coordinates far from the origin, such as UTM's.
std::vector<Change> all_changes();

/// A few of them, for the suite of tests.
std::vector<Change> few_changes();

/// Carries out a change on states, measurements and information. The types are those that the
/// project's generators use; throws `std::invalid_argument` for another.
void apply(const Change& change, Graph& graph);

/// A variable's state before the change.
std::vector<double> undone(const Change& change, const Graph& graph, int variable);

/// How many of the first numbers of a variable's tangent vector are lengths, and after how many
/// that are none: (0, 2) for a pose in the plane.
struct Lengths {
  int begin = 0, count = 0;
};
Lengths lengths_of_tangent(const VariableType& type);

/// How far rounding of positions, as the change leaves them, is expected to move chi2 at the
/// graph's states: what it does to each factor, added as what is random.
double rounding_of_chi2(const Change& change, const Graph& graph);

}  // namespace cairn::scales
