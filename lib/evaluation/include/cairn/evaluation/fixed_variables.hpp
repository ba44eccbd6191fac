// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A sentence where variables that are fixed, or placed wholly by a prior, contradict each other:
/// poses, landmarks, or both, which the measurements between them do not fit by more than five
/// standard deviations per degree of freedom wherever the variables in between are. It is on those
/// that do so by most. Where other measurements agree with them, and are certain enough to
/// contradict the first, it names the measurement that is wrong, else the variables: two maps, each
/// with its first pose fixed, are each in a frame of its own, and no optimisation can repair that.
/// Empty else, as in a graph with one such variable.
///
/// Compared are, the shortest first, some ways of measurements for each set of such variables:
/// between two along factors that determine one end by the other, such as relative poses and
/// landmarks that are seen, and between as many as determine what hangs together so without them,
/// such as a drive from which fixed landmarks are seen. Where only several such parts determine
/// each other, and by factors on more than two variables, nothing is found. Takes time in
/// proportion to the graph.
CAIRN_API std::string contradicting_fixed_variables(const Graph& graph);

}  // namespace cairn
