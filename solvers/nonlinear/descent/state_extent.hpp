// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"

namespace cairn {

/// What the length of a step is compared with: how far the states are spread, the Euclidean norm of
/// their distances from the mean of their pool in their connected component; where components are
/// single variables, from that of the pool, and of a single variable from the origin. Where states
/// lie far from the origin, as UTM coordinates do, or components far from each other, their own
/// norm is no measure of a map. At least 1e-6 of that norm, though, since states of that size are
/// rounded.
double state_extent(const Graph& graph, const Gauge& gauge, const Values& values);

}  // namespace cairn
