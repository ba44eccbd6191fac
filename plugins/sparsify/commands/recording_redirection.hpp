// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/graph/graph.hpp"

namespace cairn::app {

/// A recording whose loop closures are on nodes that will stay.
struct RedirectedRecording {
  Graph graph;
  int redirected = 0;  ///< loop closures that are on another node now
  int dropped = 0;     ///< those that are left out, since both ends became one node
};

/// Redirects a recording before it is replayed, as the data sets of Vallvé's thesis (2018, section
/// 4.6.4) were. One pose of `keep_every` will stay, the first among them, and a loop closure on an
/// older pose j that leaves is redirected to k, the nearest that stays by the poses' numbers
/// counted from one,
///
///     k = N ⌊(j + 1)/N + ½⌋,   j and k counted from zero,
///
/// and to k − N if that has not arrived yet. The measurement z of pose i from j becomes that from
/// k, z_k,k+1 ⋯ z_j-1,j z, with the odometry between the two (or its inverse) as if it were exact;
/// the information stays as it is. Measurements of other kinds are not changed.
///
/// Throws `Error` (input) where two consecutive poses between k and j have no measurement of each
/// other.
RedirectedRecording redirect_recording(const Graph& recording, int keep_every);

}  // namespace cairn::app
