// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What is added at once: a pose, the landmarks first observed from it, and the measurements of
/// which it is the latest variable.
struct Arrival {
  std::vector<int> variables;  ///< by index: the pose first
  std::vector<int> factors;    ///< by position, in the order of the graph
};

/// The order in which a graph was recorded. A step is a pose, in the order of ids, with everything
/// else of which it is the latest: the factors whose other variables are there, and the landmarks
/// that no earlier pose has seen. Every variable and every factor is in one step. A pose is a
/// variable with an orientation, or without a position; variables that share no factor with a pose
/// come with the last step (a graph without poses is one step).
CAIRN_API std::vector<Arrival> arrival_order(const Graph& graph);

/// Whether a graph lists its poses and factors in the order in which they arrived.
CAIRN_API bool in_arrival_order(const std::vector<Arrival>& arrivals);

}  // namespace cairn
