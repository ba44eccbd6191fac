// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What arrives at once: a pose, what it sees for the first time, and the measurements that became
/// possible with it.
struct Arrival {
  std::vector<int> variables;  ///< by index: the pose first
  std::vector<int> factors;    ///< by position, in the order of the graph
};

/// The order in which a graph that was recorded came about. A step is a pose, in the order of ids,
/// with everything else of which it is the latest: the factors whose other variables are there, and
/// the landmarks that no earlier pose has seen. Every variable and every factor is in one step. A
/// pose is what has an orientation, or no place in space; variables that no pose ever meets come
/// with the last step (a graph without poses is one step).
CAIRN_API std::vector<Arrival> arrival_order(const Graph& graph);

/// Whether a graph lists its poses and factors in the order in which they arrived.
CAIRN_API bool in_arrival_order(const std::vector<Arrival>& arrivals);

}  // namespace cairn
