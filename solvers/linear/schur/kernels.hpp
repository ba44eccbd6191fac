// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace cairn::schur {

/// One block of Y that belongs to an eliminated block: from where in H it is made.
struct Neighbour {
  std::int64_t source;  ///< in the values of H
  std::int64_t target;  ///< in Y
  std::int32_t block;   ///< of the reduced system
  std::int32_t rows;    ///< of that block
  bool transposed;      ///< H holds it as eliminated × remaining
};

/// A block of Y seen from the remaining block that it belongs to.
struct Incidence {
  std::int64_t place;    ///< in Y
  std::int64_t part;     ///< the eliminated block's first scalar row among the eliminated
  std::int32_t size;     ///< of the eliminated block
  std::int32_t element;  ///< which eliminated block
  std::int32_t nth;      ///< which of that block's neighbours the remaining one is
};

/// Two blocks of Y whose product is taken off one block of the reduced system; places in Y.
struct Pair {
  std::uint32_t left, right;
};

/// Doubles that may be read, but are not used, beyond the end of Y and of what Y is multiplied
/// with.
constexpr int kOverread = 8;

/// Neighbours that may be read, but are only fetched ahead, beyond the last.
constexpr int kLookahead = 6;

/// C -= Σ Y_left Y_rightᵀ over the pairs; C: rows × columns, Y_left: rows × inner, Y_right:
/// columns × inner, all column-major without gaps.
using Product = void (*)(double* C, const Pair* first, const Pair* last, const double* Y, int rows,
                         int columns, int inner);

/// Factorises H_ee = L Lᵀ (size × size, column-major; only the lower triangle is read) and makes
/// Y = H_re L⁻ᵀ (rows × size) for each neighbour. L holds the reciprocals of its diagonal there.
/// Returns false if a pivot is not positive and finite; then L and Y mean nothing.
using Eliminate = bool (*)(const double* H, std::int64_t diagonal, const Neighbour* first,
                           const Neighbour* last, double* L, double* Y, int size);

/// y -= Σ Y z over incidences of one eliminated size; Y: rows × inner. `z`: of all eliminated
/// blocks.
using Forward = void (*)(const Incidence* first, const Incidence* last, const double* Y,
                         const double* z, double* y, int rows, int inner);

/// z -= Σ Yᵀ y over neighbours of one number of rows; `y`: of all remaining blocks, which begin at
/// `begin`, with kOverread doubles more.
using Backward = void (*)(const Neighbour* first, const Neighbour* last, const double* Y,
                          const std::int64_t* begin, const double* y, double* z, int rows,
                          int inner);

/// The dense work on small blocks, for one instruction set. Each choice is made once per structure;
/// sizes 2, 3, 6 and 9 have code of their own, and any other size takes the general one.
struct Kernels {
  const char* name;
  Product (*product)(int rows, int columns, int inner);
  Eliminate (*eliminate)(int size);
  Forward (*forward)(int rows, int inner);
  Backward (*backward)(int rows, int inner);
};

/// The fastest set that this machine can run. `limit` (portable, avx2, avx512; "auto": no limit)
/// chooses a lesser one. Returns null for a name that is not known or a set that the machine cannot
/// run.
const Kernels* choose_kernels(const char* limit);

}  // namespace cairn::schur
