// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/graph/free_directions.hpp"

namespace cairn {

/// The directions of each variable that its own factors leave free if all others are constant: of a
/// point that one camera sees, or cameras at one place, its distance from there; of a camera that
/// sees two points, five of its nine. Each is free whatever else the graph holds; those in which
/// several variables move together are not looked for, so that the search is never `complete`.
///
/// Decided without the sizes of units and weights: of the factors' rows, each factor's scaled to
/// one and then each column, directions are free that they have below 1e-10, which is rounding. A
/// point that two factors of at least two numbers have from directions 1e-6 apart is determined,
/// and not examined further.
FreeDirections free_alone(const Graph& graph, const Gauge& gauge, const Values& values,
                          const LinearRows& rows);

}  // namespace cairn
