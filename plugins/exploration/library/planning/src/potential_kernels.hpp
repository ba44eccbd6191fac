// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace cairn {

/// Orientations of one parity at one cell, for a sweep of (5.9). A row of values has `stride`
/// numbers, a multiple of eight, and at least two more than it has orientations: row 2 n is that of
/// the even ones of cell n, row 2 n + 1 that of the odd ones. Behind the values of an even row its
/// first stands again; its last number is the last value of the odd row behind it, again. So the
/// orientations beside an orientation are always beside each other in the other row.
struct PotentialRows {
  std::size_t half;    ///< orientations in a row
  std::size_t stride;  ///< numbers in a row
  double* values;
  const double* nothing;           ///< a row of zeros
  const std::int32_t* neighbours;  ///< four of each cell; −1: none
  const std::int32_t* free_row;    ///< by row: which row of `free` it has, −1: all are free
  const std::int64_t* free;        ///< rows: −1 where a value is free to change, else 0
  double keeps;                    ///< 1 − ω
  double factor[5];                ///< ω over the divisor, by neighbours that are not there
  double least;                    ///< changes are relative to at least this
};

/// Updates the orientations of `parity` at cell `cell`. `largest`, the largest relative change so
/// far, is raised where one is larger; it may be null.
using RelaxRow = void (*)(const PotentialRows& rows, std::size_t cell, std::size_t parity,
                          double* largest);

/// The fastest that this machine can run: compiled for AVX-512, for AVX2 with FMA, or portable.
/// `limit`: as `choose_kernels` has it, null where it says no.
RelaxRow choose_relax_row(std::string_view limit);

}  // namespace cairn
