// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

namespace cairn::performance {

// What the machine can do with one thread: the roofs over every factorisation.

/// Rate of OpenBLAS' dgemm on square matrices of `size`, one thread, the best of a few calls; empty
/// where there is no OpenBLAS to open.
std::optional<double> dgemm_rate(int size = 1024);

/// Bytes a second of a[i] = b[i] + s c[i] over arrays far larger than the caches, three transfers a
/// step, one thread, the best of a few passes (McCalpin's STREAM triad).
double triad_bandwidth();

}  // namespace cairn::performance
