// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/io/random_numbers.hpp"

namespace cairn::app {

/// Paths to random cells of the known floor, each at least a step away, on different cells.
std::vector<PlannedPath> random_paths(const Situation& situation, PathPlanner& planner, int count,
                                      RandomNumbers& random);

}  // namespace cairn::app
