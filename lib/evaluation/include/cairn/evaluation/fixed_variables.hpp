// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A sentence where fixed poses of one component contradict each other: where the relative
/// measurements from one to the other, on a path with the fewest of them, lead to another place
/// than where that is fixed, by more than five standard deviations per degree of freedom. It names
/// the two that do so by most. Empty else, as in a graph with one fixed pose. That no optimisation
/// can repair: two maps, each with its first pose fixed, are each in a frame of its own. Takes time
/// in proportion to the graph where two poses are fixed, and none where not.
CAIRN_API std::string contradicting_fixed_poses(const Graph& graph);

}  // namespace cairn
