// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/graph/graph.hpp"

namespace cairn::app {

/// Takes the information Λ of each EDGE_SE2 of `graph`, with translation t and rotation matrix R of
/// what it measures, as that of the residual
///
///     (t_ab − t, θ_ab − θ)            in the frame of pose a,
///
/// where T_ab is pose b in the frame of pose a, instead of (Rᵀ (t_ab − t), θ_ab − θ), which is
/// g2o's and cairn's. The same errors then have the same chi2 with diag(Rᵀ, 1) Λ diag(R, 1), which
/// becomes the information; only where the translation is isotropic does it make no difference.
/// Nothing else is changed.
///
/// Throws `Error` (usage) where there are relative factors between poses of another type.
void information_of_first_frame(Graph& graph);

}  // namespace cairn::app
