// SPDX-License-Identifier: BSD-3-Clause
//
// The kernels of kernels.hpp, compiled once for each instruction set: the including file sets
// CAIRN_KERNEL_SET (a name) and CAIRN_KERNEL_WIDTH (doubles in a vector register), and is compiled
// with that set's flags.
//
// Nothing but raw pointers and builtins may stand here: an inline function of the standard library,
// compiled here for a newer machine, could be the copy that the linker keeps for everyone.

#include "kernels.hpp"

namespace cairn::block::CAIRN_KERNEL_SET {
namespace {

constexpr int kWidth = CAIRN_KERNEL_WIDTH;
typedef double Vec __attribute__((vector_size(kWidth * sizeof(double))));
typedef double LooseVec __attribute__((vector_size(kWidth * sizeof(double)), aligned(8)));

inline __attribute__((always_inline)) Vec load(const double* p) {
  return *reinterpret_cast<const Vec*>(p);
}
inline __attribute__((always_inline)) void store(double* p, Vec v) {
  *reinterpret_cast<Vec*>(p) = v;
}
inline __attribute__((always_inline)) Vec load_loose(const double* p) {
  return *reinterpret_cast<const LooseVec*>(p);
}
inline __attribute__((always_inline)) void store_loose(double* p, Vec v) {
  *reinterpret_cast<LooseVec*>(p) = v;
}
inline __attribute__((always_inline)) Vec broadcast(double value) { return Vec{} + value; }

/// Vectors of rows that a tile is high: as many as leave room for the tile in registers.
constexpr int kTileVectors = kWidth >= 4 ? 3 : 2;
/// Columns that a tile is wide.
constexpr int kTileColumns = kWidth == 8 ? 8 : 4;
/// Columns of a panel that are factored together.
constexpr int kPanelColumns = 8;

/// C (+)= -A Bᵀ on a tile of V vectors of rows and N columns; A: rows × K, B: N rows × K, all
/// column-major.
template <int V, int N, bool kAccumulate>
inline __attribute__((always_inline)) void tile(int K, const double* A, std::int64_t lda,
                                                const double* B, std::int64_t ldb, double* C,
                                                std::int64_t ldc) {
  Vec sum[N][V];
  for (int n = 0; n < N; ++n) {
    for (int v = 0; v < V; ++v) sum[n][v] = kAccumulate ? load(C + n * ldc + v * kWidth) : Vec{};
  }
  for (int k = 0; k < K; ++k) {
    Vec a[V];
    for (int v = 0; v < V; ++v) a[v] = load(A + k * lda + v * kWidth);
    const double* b = B + k * ldb;
    for (int n = 0; n < N; ++n) {
      const Vec bn = broadcast(b[n]);
      for (int v = 0; v < V; ++v) sum[n][v] -= a[v] * bn;
    }
  }
  for (int n = 0; n < N; ++n) {
    for (int v = 0; v < V; ++v) store(C + n * ldc + v * kWidth, sum[n][v]);
  }
}

/// The same for N not known when compiling.
template <int V, bool kAccumulate>
void tile_of(int N, int K, const double* A, std::int64_t lda, const double* B, std::int64_t ldb,
             double* C, std::int64_t ldc) {
  static_assert(kTileColumns == 8 || kTileColumns == 4);
  if constexpr (kTileColumns == 8) {
    switch (N) {
      case 8:
        return tile<V, 8, kAccumulate>(K, A, lda, B, ldb, C, ldc);
      case 7:
        return tile<V, 7, kAccumulate>(K, A, lda, B, ldb, C, ldc);
      case 6:
        return tile<V, 6, kAccumulate>(K, A, lda, B, ldb, C, ldc);
      case 5:
        return tile<V, 5, kAccumulate>(K, A, lda, B, ldb, C, ldc);
      default:
        break;
    }
  }
  switch (N) {
    case 4:
      return tile<V, 4, kAccumulate>(K, A, lda, B, ldb, C, ldc);
    case 3:
      return tile<V, 3, kAccumulate>(K, A, lda, B, ldb, C, ldc);
    case 2:
      return tile<V, 2, kAccumulate>(K, A, lda, B, ldb, C, ldc);
    case 1:
      return tile<V, 1, kAccumulate>(K, A, lda, B, ldb, C, ldc);
    default:
      return;
  }
}

template <bool kAccumulate>
void tile_of(int vectors, int N, int K, const double* A, std::int64_t lda, const double* B,
             std::int64_t ldb, double* C, std::int64_t ldc) {
  if constexpr (kTileVectors == 3) {
    if (vectors == 3) return tile_of<3, kAccumulate>(N, K, A, lda, B, ldb, C, ldc);
  }
  if (vectors == 2) return tile_of<2, kAccumulate>(N, K, A, lda, B, ldb, C, ldc);
  if (vectors == 1) return tile_of<1, kAccumulate>(N, K, A, lda, B, ldb, C, ldc);
}

constexpr int min(int a, int b) { return a < b ? a : b; }

// --- factor_panel
// -----------------------------------------------------------------------------------------------------

/// Subtracts what the columns to the left contribute to columns [begin, begin + N), from row
/// `begin` down.
void update_columns(double* panel, std::int64_t stride, int begin, int N) {
  constexpr int kHeight = kTileVectors * kWidth;
  for (int row = begin; row < stride; row += kHeight) {
    const int vectors = min(kTileVectors, static_cast<int>(stride - row) / kWidth);
    for (int n = 0; n < N; n += kTileColumns) {
      tile_of<true>(vectors, min(kTileColumns, N - n), begin, panel + row, stride,
                    panel + begin + n, stride, panel + (begin + n) * stride + row, stride);
    }
  }
}

/// Factors the N × N diagonal block at `diagonal` (lower triangle) and writes the reciprocals of
/// its pivots.
template <int N>
int factor_diagonal(double* diagonal, std::int64_t stride, double* reciprocal) {
  int failed = -1;
  double a[N][N];
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) a[j][i] = diagonal[j * stride + i];
  }
  for (int j = 0; j < N; ++j) {
    double pivot = a[j][j];
    if (!(pivot > 0.0) || pivot > 1.7e308) {
      if (failed < 0) failed = j;
      pivot = 1.0;
    }
    const double root = __builtin_sqrt(pivot);
    const double inverse = 1.0 / root;
    reciprocal[j] = inverse;
    a[j][j] = root;
    for (int i = j + 1; i < N; ++i) a[j][i] *= inverse;
    for (int k = j + 1; k < N; ++k) {
      for (int i = k; i < N; ++i) a[k][i] -= a[j][i] * a[j][k];
    }
  }
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) diagonal[j * stride + i] = a[j][i];
  }
  return failed;
}

/// X ← X L⁻ᵀ for V vectors of rows, with the N × N lower triangle L at `diagonal`.
template <int V, int N>
inline __attribute__((always_inline)) void solve_rows(double* X, std::int64_t stride,
                                                      const double* diagonal,
                                                      const double* reciprocal) {
  Vec x[N][V];
  for (int j = 0; j < N; ++j) {
    for (int v = 0; v < V; ++v) x[j][v] = load_loose(X + j * stride + v * kWidth);
  }
  for (int j = 0; j < N; ++j) {
    const Vec inverse = broadcast(reciprocal[j]);
    for (int v = 0; v < V; ++v) x[j][v] *= inverse;
    for (int k = j + 1; k < N; ++k) {
      const Vec l = broadcast(diagonal[j * stride + k]);
      for (int v = 0; v < V; ++v) x[k][v] -= x[j][v] * l;
    }
  }
  for (int j = 0; j < N; ++j) {
    for (int v = 0; v < V; ++v) store_loose(X + j * stride + v * kWidth, x[j][v]);
  }
}

/// Factors columns [begin, begin + N), already updated from the left. The rows of the diagonal
/// block are done first, scalar by scalar; then those below, vector by vector, the first vector
/// beginning right below the diagonal block where it can, so that nothing above is touched twice.
template <int N>
int factor_columns(double* panel, std::int64_t stride, int begin) {
  double reciprocal[N];
  double* block = panel + begin * stride;
  const int failed = factor_diagonal<N>(block + begin, stride, reciprocal);
  const double* diagonal = block + begin;
  int row = begin + N;
  // Single rows up to the next vector boundary (N < 8 only in a panel's last columns).
  for (; row < stride && row % kWidth != 0; ++row) {
    double x[N];
    for (int j = 0; j < N; ++j) x[j] = block[j * stride + row];
    for (int j = 0; j < N; ++j) {
      x[j] *= reciprocal[j];
      for (int k = j + 1; k < N; ++k) x[k] -= x[j] * diagonal[j * stride + k];
    }
    for (int j = 0; j < N; ++j) block[j * stride + row] = x[j];
  }
  if constexpr (kWidth > 2) {
    for (; row + 2 * kWidth <= stride; row += 2 * kWidth)
      solve_rows<2, N>(block + row, stride, diagonal, reciprocal);
  }
  for (; row < stride; row += kWidth) solve_rows<1, N>(block + row, stride, diagonal, reciprocal);
  return failed < 0 ? -1 : begin + failed;
}

int factor_panel(double* panel, std::int64_t stride, int columns) {
  int failed = -1;
  for (int begin = 0; begin < columns; begin += kPanelColumns) {
    const int N = min(kPanelColumns, columns - begin);
    if (begin > 0) update_columns(panel, stride, begin, N);
    int column = -1;
    switch (N) {
      case 8:
        column = factor_columns<8>(panel, stride, begin);
        break;
      case 7:
        column = factor_columns<7>(panel, stride, begin);
        break;
      case 6:
        column = factor_columns<6>(panel, stride, begin);
        break;
      case 5:
        column = factor_columns<5>(panel, stride, begin);
        break;
      case 4:
        column = factor_columns<4>(panel, stride, begin);
        break;
      case 3:
        column = factor_columns<3>(panel, stride, begin);
        break;
      case 2:
        column = factor_columns<2>(panel, stride, begin);
        break;
      default:
        column = factor_columns<1>(panel, stride, begin);
        break;
    }
    if (failed < 0) failed = column;
  }
  return failed;
}

// --- update
// -----------------------------------------------------------------------------------------------------------

void update(const double* panel, std::int64_t stride, int columns, int m, double* U, int row_begin,
            int row_end) {
  constexpr int kHeight = kTileVectors * kWidth;
  const int shift = columns / 8 * 8;
  const std::int64_t ldu = stride - shift;
  for (int row = row_begin; row < row_end; row += kHeight) {
    const int vectors = min(kTileVectors, (row_end - row) / kWidth);
    const int last_column = min(m, row + vectors * kWidth);  // columns up to the tile's last row
    for (int column = columns; column < last_column; column += kTileColumns) {
      tile_of<false>(vectors, min(kTileColumns, last_column - column), columns, panel + row, stride,
                     panel + column, stride, U + (column - columns) * ldu + (row - shift), ldu);
    }
  }
}

// --- extend_add
// -------------------------------------------------------------------------------------------------------

inline __attribute__((always_inline)) void add(double* target, const double* source, int length) {
  int k = 0;
  for (; k + kWidth <= length; k += kWidth) {
    store_loose(target + k, load_loose(target + k) + load_loose(source + k));
  }
  for (; k < length; ++k) target[k] += source[k];
}

void extend_add(const Run* runs, int first, int last, int count, const double* child,
                std::int64_t child_stride, int child_shift, double* panel, std::int64_t stride,
                int columns, double* U) {
  const int shift = columns / 8 * 8;
  const std::int64_t ldu = stride - shift;
  for (int r = first; r < last; ++r) {
    const Run& run = runs[r];
    for (int c = 0; c < run.length; ++c) {
      const double* source = child + (run.source + c) * child_stride + child_shift;
      const int column = run.target + c;
      double* target =
          column < columns ? panel + column * stride : U + (column - columns) * ldu - shift;
      add(target + column, source + run.source + c, run.length - c);
      for (int q = r + 1; q < count; ++q)
        add(target + runs[q].target, source + runs[q].source, runs[q].length);
    }
  }
}

// --- solve
// ------------------------------------------------------------------------------------------------------------

void forward(const double* panel, std::int64_t stride, int columns, int m, double* x) {
  for (int j = 0; j < columns; ++j) {
    const double* column = panel + j * stride;
    const double xj = x[j] / column[j];
    x[j] = xj;
    const Vec factor = broadcast(xj);
    int i = j + 1;
    for (; i + kWidth <= m; i += kWidth)
      store_loose(x + i, load_loose(x + i) - load_loose(column + i) * factor);
    for (; i < m; ++i) x[i] -= column[i] * xj;
  }
}

void backward(const double* panel, std::int64_t stride, int columns, int m, double* x) {
  for (int j = columns - 1; j >= 0; --j) {
    const double* column = panel + j * stride;
    Vec sums{};
    int i = j + 1;
    for (; i + kWidth <= m; i += kWidth) sums += load_loose(column + i) * load_loose(x + i);
    double sum = x[j];
    for (int v = 0; v < kWidth; ++v) sum -= sums[v];
    for (; i < m; ++i) sum -= column[i] * x[i];
    x[j] = sum / column[j];
  }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{CAIRN_KERNEL_NAME, &factor_panel, &update, &extend_add, &forward, &backward};

}  // namespace cairn::block::CAIRN_KERNEL_SET
