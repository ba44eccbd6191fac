// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

namespace cairn {

/// Kendall's τ_b between two orders of the same things, given by their values: (C − D) /
/// sqrt((P − T_a)(P − T_b)) over all P pairs, of which C are in the same order in both, D in
/// opposite orders, T_a tied in `a`, and T_b in `b`. 1: the same order, −1: the opposite one. NaN
/// if all of one are tied. n² operations. Throws `Error` (usage) for different sizes.
double kendall_tau(std::span<const double> a, std::span<const double> b);

}  // namespace cairn
