// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// Names a factor one of whose errors is an angle that is not wrapped to ±π, and lies beyond that:
/// while a variable turns once about itself, the error turns with it. Looks at the factor of each
/// type that contributes most to chi2 at the graph's states. Empty if there is none.
std::string unwrapped_angle(const Graph& graph);

}  // namespace cairn
