// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A sentence where poses of one component that are fixed, or placed wholly by a prior, contradict
/// each other: where relative measurements from one to the other lead to another place than where
/// that is, by more than five standard deviations per degree of freedom. It is on the two that do
/// so by most. Where another path of measurements agrees with both, and is certain enough to
/// contradict the first, it names the measurement that is wrong, else the two poses: two maps,
/// each with its first pose fixed, are each in a frame of its own, and no optimisation can repair
/// that. Empty else, as in a graph with one such pose. Compared are at most 1,000 paths, those with
/// the fewest measurements first, of relative poses of full rank: contradictions through landmarks,
/// and between fixed landmarks, are not found. Takes time in proportion to the graph.
CAIRN_API std::string contradicting_fixed_poses(const Graph& graph);

}  // namespace cairn
