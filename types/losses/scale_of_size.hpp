// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::losses {

/// The scale for residuals of n numbers where that of one number is c₁:
///   c_n = c₁ √(q(n) / q(1)),   q(n) the 95 % quantile of χ² with n degrees of freedom,
/// so that a right residual, whose squared norm is χ², is as far from the scale for any n:
/// √(q(n)/q(1)) is 1, 1.25, 1.43, 1.57, 1.70, 1.81 for n = 1 … 6.
double scale_of_size(double scale_of_one, int n);

}  // namespace cairn::losses
