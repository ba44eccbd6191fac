// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/graph/graph.hpp"

namespace cairn::formats {

struct Propagation {
  int roots = 0;  ///< variables that had to start at the identity, or at their prior
};

/// First states for a graph whose file gives none. Variables are reached from a root in the order
/// of their indices: a pose through the relative measurement that joins it to the nearest pose
/// before it (the odometry chain, where there is one), anything else through the first factor in
/// the file that determines it. A root stands at its prior if it has one, else at the identity and
/// where priors on some of its components put it. Components without information are not used: a
/// variable that only such measurements reach stays, in the directions that they lack, beside the
/// variable that it is seen from.
Propagation propagate_states(Graph& graph);

}  // namespace cairn::formats
