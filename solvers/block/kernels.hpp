// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace cairn::block {

/// A stretch of consecutive scalar rows below a supernode's diagonal block: where they are in the
/// permuted vector and in the supernode's front.
struct Run {
  std::int32_t source;  ///< first row in the vector
  std::int32_t target;  ///< first row in the front
  std::int32_t length;
};

/// Eight rows of a parent's front, and which of them are rows of a child's update matrix. Both
/// count their rows in the same order, so the child's are consecutive.
struct Spread {
  std::int32_t source;  ///< the child's first row among them, counted from its first row below its
                        ///< diagonal block
  std::int32_t target;  ///< first of the eight rows in the parent's front, a multiple of 8
  std::uint8_t mask;    ///< bit k: row target + k is one of the child's
  std::uint8_t packed;  ///< as many bits, from the lowest on: those to load
};

/// Where an entry of H goes: into a panel, straight or transposed.
struct Assembly {
  std::int64_t source;         ///< in the values of H
  std::int64_t target;         ///< in the factor's values
  std::int16_t rows, columns;  ///< of the source block
  std::int32_t stride;         ///< of the panel
  bool transpose;
};

/// Chains of equal length side by side, one in each lane of a vector (see `Chains`). Node k of a
/// chain lies between nodes k-1 and k+1, the first one after the first separator, the last one
/// before the last.
struct ChainGroup {
  static constexpr std::int64_t kZero = -1,  ///< there is no such block, or no such row
      kIdentity = -2;                        ///< a diagonal block of a lane without a chain
  int length = 0;                            ///< nodes of each chain
  const std::int64_t* diagonal = nullptr;    ///< length × lanes: H_kk, in the values of H
  const std::int64_t* coupling = nullptr;    ///< (length + 1) × lanes: the block of k-1 and k
  const std::int64_t* turned = nullptr;      ///< as coupling: -1 where its rows are those of k-1
  const std::int64_t* row = nullptr;         ///< length × lanes: first scalar row of each node
};

/// Elimination of chains of blocks of one size, d. For each node, with L Lᵀ its diagonal block as
/// eliminating the nodes before has left it, V = L⁻¹ H_k,k+1 and W = L⁻¹ C, C being its block with
/// the first separator. `panel` holds for each node L below its diagonal, the reciprocals of that,
/// V and W, both row by row: d(d+1)/2 + 2d² numbers of all lanes, on a 64-byte boundary.
struct ChainKernels {
  /// Writes what eliminating the chains adds to the blocks of the first and of the last separator
  /// and to their common one (rows of the last): 3d² numbers for each lane. Returns a bit for each
  /// lane in which a pivot is not positive.
  unsigned (*eliminate)(const ChainGroup& group, const double* values, double* panel, double* ends);
  /// y = L⁻¹ g along the chains, d numbers of all lanes for each node; writes what that adds to g
  /// of the first and of the last separator: 2d numbers for each lane.
  void (*forward)(const ChainGroup& group, const double* panel, const double* g, double* y,
                  double* ends);
  /// x = L⁻ᵀ y, given x of the separators.
  void (*backward)(const ChainGroup& group, const double* panel, const double* y,
                   const double* ends, double* x);
};

/// The dense work on one supernode, for one instruction set and one precision (Real: double
/// or float).
///
/// The *front* of a supernode has m rows: its own `columns` (scalar) columns first, then the rows
/// below. The *panel* holds the front's first `columns` columns, column-major, leading dimension
/// `stride`, a multiple of 8, on a 64-byte boundary; rows m … stride-1 are padding: zero before,
/// and zero after. The *update matrix* holds what the supernode contributes to its ancestors, the
/// rest of the front's lower triangle. Its row r (counted in the front) is stored at r -
/// 8⌊columns/8⌋, so that panel and update matrix have the same rows in one vector; its columns are
/// counted from `columns`; leading dimension stride - 8⌊columns/8⌋. What lies above the diagonal is
/// zero in a factored panel's diagonal blocks of one vector, else not defined.
template <class Real>
struct FrontKernels {
  /// Sets a panel of `size` numbers (a multiple of 8) to zero and writes `count` entries of H into
  /// it.
  void (*assemble)(const Assembly* entries, int count, const double* values, Real* panels,
                   Real* panel, std::int64_t size);

  /// Cholesky factorisation of columns [first, last) of the panel in place, those before being
  /// done, in rows first … row_end-1: the diagonal block becomes L_JJ, the rows below
  /// L_RJ = A_RJ L_JJ⁻ᵀ. What the columns before `from` contribute has been subtracted
  /// (`subtract`). `from`, `first` and `row_end` are multiples of 8. Returns -1, or the first
  /// column whose pivot is not positive; what follows it is then worthless.
  int (*factor_panel)(Real* panel, std::int64_t stride, int from, int first, int last, int row_end);
  /// The rows [row_begin, row_end), multiples of 8, of columns whose diagonal block is done by
  /// `factor_panel`.
  void (*factor_rows)(Real* panel, std::int64_t stride, int from, int first, int last,
                      int row_begin, int row_end);
  /// A_RJ -= L_RK L_JKᵀ for the columns J = [first, last) and K = [0, first), those of K being
  /// done, in the rows [row_begin, row_end), multiples of 8 as `first` is; what it leaves above the
  /// diagonal is not defined.
  void (*subtract)(Real* panel, std::int64_t stride, int first, int last, int row_begin,
                   int row_end);

  /// U = -L_RJ L_RJᵀ for the vectors of rows [row_begin, row_end) of the front, both multiples
  /// of 8.
  void (*update)(const Real* panel, std::int64_t stride, int columns, int m, Real* U, int row_begin,
                 int row_end);

  /// Adds columns [first, last) of a child's update matrix, whose row 0 is at `child`, to the
  /// parent's front: all of them to the panel, or all to the update matrix, `parent` being where
  /// row and column 0 of the front are or would be.
  void (*extend_add)(const Spread* spreads, int count, int first, int last, const Real* child,
                     std::int64_t child_stride, Real* parent, std::int64_t parent_stride);

  /// x = L⁻¹ x for one supernode. `own`: its `columns` entries of x; `runs`: where its rows below
  /// are, as stretches of `vector` (source) and of the front (target), and there they are
  /// updated. `front`: room for `stride` numbers on a 64-byte boundary.
  void (*forward)(const Real* panel, std::int64_t stride, int columns, Real* own, const Run* runs,
                  int count, Real* vector, Real* front);
  /// x = L⁻ᵀ x for one supernode: the rows below are only read.
  void (*backward)(const Real* panel, std::int64_t stride, int columns, int m, Real* own,
                   const Run* runs, int count, const Real* vector, Real* front);
};

/// The same in double precision, and what there is in that alone.
struct Kernels : FrontKernels<double> {
  const char* name;
  int lanes;  ///< doubles in a vector: chains that are eliminated side by side
  const FrontKernels<float>* single;  ///< of the same instruction set
  ChainKernels chains[2];             ///< of blocks of size 3 and of size 6

  /// `forward` and `backward` for eight right-hand sides side by side: every row of `own`, `vector`
  /// and `front` is eight doubles on a 64-byte boundary.
  void (*forward_many)(const double* panel, std::int64_t stride, int columns, double* own,
                       const Run* runs, int count, double* vector, double* front);
  void (*backward_many)(const double* panel, std::int64_t stride, int columns, int m, double* own,
                        const Run* runs, int count, const double* vector, double* front);

  // Selected inversion: blocks of Z = H⁻¹. `Z` is a panel laid out as that of L, with Z_JJ whole;
  // `U` holds Z_RR, laid out as an update matrix but with both triangles, and zeros in the rows of
  // its vectors that are no rows of R. c8 is `columns` rounded up to 8.

  /// Rows [row_begin, row_end), multiples of 8, of V = L_JJ⁻ᵀ: c8 × columns, upper triangular, all
  /// of it zero before.
  void (*invert_pivots)(const double* panel, std::int64_t stride, int columns, double* V,
                        int row_begin, int row_end);
  /// Columns [first, last) of T = V L_RJᵀ, which is Yᵀ for Y = L_RJ L_JJ⁻¹: c8 × rows below.
  void (*transform_rows)(const double* panel, std::int64_t stride, int columns, const double* V,
                         double* T, int first, int last);
  /// Z_RJ = -Z_RR Y for the vectors of rows [row_begin, row_end) of the front, multiples of 8.
  void (*inverse_rows)(const double* U, std::int64_t stride, int columns, int m, const double* T,
                       double* Z, int row_begin, int row_end);
  /// Rows [row_begin, row_end), multiples of 8, of the lower triangle of Z_JJ = V Vᵀ - Yᵀ Z_RJ, and
  /// what mirrors them above the diagonal. After `inverse_rows`, which spoils the last of Z_JJ.
  void (*inverse_pivots)(const double* V, const double* T, std::int64_t stride, int columns, int m,
                         double* Z, int row_begin, int row_end);
  /// Takes columns [first, last) of a child's Z_RR out of its parent's front, `parent` being where
  /// row and column 0 of the front are or would be, from the vector on that has the child's row
  /// `from`; `lead` is the place of row 0 in the column. What is no row of the child becomes zero.
  void (*gather)(const Spread* spreads, int count, int first, int last, int from, double* U,
                 std::int64_t child_stride, int lead, const double* parent,
                 std::int64_t parent_stride);
  /// Rows [0, from) of columns [first, last) of U, copied from the other side of the diagonal.
  void (*mirror)(double* U, std::int64_t child_stride, int lead, int from, int first, int last);
};

/// The fastest set that this machine can run, chosen once. `limit` (portable, avx2, avx512; "auto":
/// no limit) chooses a lesser one. Returns null for a name that is not known or a set that the
/// machine cannot run.
const Kernels* choose_kernels(const char* limit);

}  // namespace cairn::block
