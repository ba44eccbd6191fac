// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include "problem.hpp"

namespace cairn::incremental {

/// Σ_ab of steps as seen from the poses (x ⊕ δ), size_a × size_b, column-major: a kept block or by
/// solving. False if H is singular, if only to rounding.
bool covariance(Problem& problem, int a, int b, double* block);
/// The rows of Σ_vb for all of `rows`, one below the other, by solving.
bool covariance_column(Problem& problem, std::span<const std::int32_t> rows, int b, double* column);

}  // namespace cairn::incremental
