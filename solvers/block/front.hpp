// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "block/kernels.hpp"

namespace cairn::block {

// What the batch and the incremental factorisation do alike with one front (see `Kernels` for how
// its panel and its update matrix lie).

/// Whether a front of m rows is worth tiles and strips.
inline bool is_large(std::int64_t m) { return m * m > 256 * 256; }

/// Large fronts are worked off in tiles of so many rows. The columns of their panels are factored
/// in strips of so many, …
inline constexpr int kTileRows = 96;
inline constexpr int kStripColumns = 48;
/// … from which the columns before them are subtracted in blocks of several strips: of a panel that
/// no cache holds, memory is read once for each block, not for each strip.
inline constexpr int kBlockColumns = 4 * kStripColumns;
/// The first column of the block that a column is in.
inline int block_of(int column) { return column / kBlockColumns * kBlockColumns; }

/// Factors the whole panel of a front of m rows, in strips of columns if it is large. Returns -1,
/// or the first column whose pivot is not positive.
template <class Real>
int factor_front(const FrontKernels<Real>& kernels, Real* panel, std::int64_t stride, int columns,
                 int m);

/// Notes that `size` rows of a child's update matrix, from `source` on, are rows `target` … of its
/// parent's front. `begin`: where this child's spreads start in `spreads`.
void append_rows(std::vector<Spread>& spreads, std::size_t begin, std::int32_t source,
                 std::int32_t target, std::int32_t size);

/// Doubles of room that `invert_front` takes.
std::int64_t room_to_invert(int columns, int m);
/// Z_JJ and Z_RJ of Z = H⁻¹ in the columns of one front, given L there and Z_RR in `U` (see
/// `SelectedInverse`).
void invert_front(const Kernels& kernels, const double* panel, std::int64_t stride, int columns,
                  int m, const double* U, double* Z, double* room);

}  // namespace cairn::block
