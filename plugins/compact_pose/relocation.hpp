// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "rigid_group.hpp"

namespace cairn::compact {

/// How the information Σ_y⁻¹ of a match is divided between two uses that are treated as
/// independent: the part w ends the way that led here, 1 − w begins the next.
struct Division {
  double way = 0.5;   ///< w, more than 0 and at most ½
  double lost = 0.0;  ///< by the two together, beside a match that both could use whole [nats]
};

/// The division that loses least. With the covariance W of the way, a link by way and match has W +
/// Σ_y / w instead of W + Σ_y, and the next way begins with Σ_y / (1 − w) instead of Σ_y:
///
///     lost(w) = ½ ln(|W + Σ_y / w| / |W + Σ_y|) − n/2 ln(1 − w)
///
/// Where the way is short (W → 0) it is in halves, and n ln 2 is lost. The larger W is beside Σ_y,
/// the less of the match the way needs: w → 0, and nothing is lost.
Division divide_match(const Matrix& way, const Matrix& match);

}  // namespace cairn::compact
