// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/graph/graph.hpp"

namespace cairn::initial {

/// Moves each connected part of a graph, as a rigid body, to where its absolute positions were
/// measured, such as GNSS fixes of poses, altitudes and known landmarks: the motion T that
/// minimises Σ ‖T t_k − p_k‖², p_k being the position nearest to T t_k that meets measurement k
/// (iterated closest points where only a part of a position was measured; otherwise Horn's closed
/// form). What they leave open, such as a rotation about a single fix, stays. A part with a
/// constant variable, or with a prior that measures a pose wholly, stays where that puts it, and so
/// does one whose absolute factors would weigh more after the motion.
void align_with_positions(Graph& graph);

}  // namespace cairn::initial
