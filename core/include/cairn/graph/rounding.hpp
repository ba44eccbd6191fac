// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/runtime/api.hpp"

namespace cairn {

// Matrices of rank less than full are indefinite by the rounding of their entries where these were
// printed with a few digits or kept in single precision. Matrices are packed (`packed.hpp`).

/// Replaces a symmetric n × n matrix A by the nearest positive semidefinite one, if one may have
/// been rounded to A: if vᵀ A v ≥ −|v|ᵀ R |v| for each eigenvector v with a negative eigenvalue, R
/// being the rounding of each entry (packed like A). No semidefinite matrix within R of A fails
/// that. Nearest, and eigenvectors, are those of A scaled to a common rounding of the diagonal, so
/// that metres and radians do not matter. False, and nothing is changed, where A is indefinite by
/// more.
CAIRN_API bool settle_rounding(int n, std::span<const double> rounding, std::span<double> A);

/// Whether every number is one of single precision.
CAIRN_API bool are_floats(std::span<const double> numbers);

/// Adds what computing in single precision may have changed of an n × n matrix A that is
/// semidefinite: of the product BᵀB of n numbers each, n 2⁻²⁴ √(A_ii A_jj) in entry (i, j).
CAIRN_API void add_float_rounding(int n, std::span<const double> A, std::span<double> rounding);

/// `square_root` for numbers of double precision whatever they are: false where A is semidefinite
/// only by the rounding of floats.
CAIRN_API bool square_root_of_doubles(std::span<const double> A, int n, std::span<double> root);

}  // namespace cairn
