// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "rigid_group.hpp"

namespace cairn::compact {

/// How the information Σ_y⁻¹ of a match is divided between two uses that are treated as
/// independent: the part w, which is returned, ends the way that led here, 1 − w begins the next.
/// With the covariance W of the way, a link by way and match has W + Σ_y / w instead of W + Σ_y,
/// and the next way begins with Σ_y / (1 − w) instead of Σ_y. w loses least by the two together
/// [nats],
///
///     lost(w) = ½ ln(|W + Σ_y / w| / |W + Σ_y|) − n/2 ln(1 − w),
///
/// and is more than 0 and at most ½: half where the way is short (W → 0), and the smaller the
/// larger W is beside Σ_y. `way` and `match` are covariances, n × n, of one tangent space.
double part_of_way(const Matrix& way, const Matrix& match);

}  // namespace cairn::compact
