// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace cairn::block {

/// A stretch of consecutive scalar rows of a child's update matrix, and where they lie in the front
/// of its parent.
struct Run {
  std::int32_t source;  ///< first row, counted from the child's first row below its diagonal block
  std::int32_t target;  ///< first row in the parent's front
  std::int32_t length;
};

/// The dense work on one supernode, for one instruction set.
///
/// The *front* of a supernode has m rows: its own `columns` (scalar) columns first, then the rows
/// below. The *panel* holds the front's first `columns` columns, column-major, leading dimension
/// `stride`, a multiple of 8, on a 64-byte boundary; rows m … stride-1 are padding that is computed
/// with but never read into a result. The *update matrix* holds what the supernode contributes to
/// its ancestors, the rest of the front's lower triangle. Its row r (counted in the front) is
/// stored at r - 8⌊columns/8⌋, so that panel and update matrix have the same rows in one vector;
/// its columns are counted from `columns`; leading dimension stride - 8⌊columns/8⌋. What lies above
/// the diagonal of either is not defined.
struct Kernels {
  const char* name;

  /// Cholesky factorisation of the panel in place: the diagonal block becomes L_JJ, the rows below
  /// L_RJ = A_RJ L_JJ⁻ᵀ. Returns -1, or the first column whose pivot is not positive (its pivot is
  /// then replaced by 1, and so on).
  int (*factor_panel)(double* panel, std::int64_t stride, int columns);

  /// U = -L_RJ L_RJᵀ for the vectors of rows [row_begin, row_end) of the front, both multiples
  /// of 8.
  void (*update)(const double* panel, std::int64_t stride, int columns, int m, double* U,
                 int row_begin, int row_end);

  /// Adds the child's update matrix to the parent's front, for the child's columns in runs [first,
  /// last): into the panel where the target lies in it, else into the parent's update matrix. Runs
  /// may not straddle the panel's edge.
  void (*extend_add)(const Run* runs, int first, int last, int count, const double* child,
                     std::int64_t child_stride, int child_shift, double* panel, std::int64_t stride,
                     int columns, double* U);

  /// x = L⁻¹ x for one supernode: x holds m entries; those below the diagonal block are updated.
  void (*forward)(const double* panel, std::int64_t stride, int columns, int m, double* x);
  /// x = L⁻ᵀ x for one supernode: the entries below the diagonal block are only read.
  void (*backward)(const double* panel, std::int64_t stride, int columns, int m, double* x);
};

/// The fastest set that this machine can run, chosen once. `limit` (portable, avx2, avx512; "auto":
/// no limit) chooses a lesser one. Returns null for a name that is not known or a set that the
/// machine cannot run.
const Kernels* choose_kernels(const char* limit);

}  // namespace cairn::block
