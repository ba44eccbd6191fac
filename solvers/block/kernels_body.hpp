// SPDX-License-Identifier: BSD-3-Clause
//
// The kernels of kernels.hpp, compiled once for each instruction set: the including file sets
// CAIRN_KERNEL_SET and CAIRN_KERNEL_NAME (a name), CAIRN_KERNEL_SINGLE (1 for numbers in single
// precision), CAIRN_KERNEL_WIDTH (numbers in a vector) and CAIRN_KERNEL_TILE (vectors of rows that
// a tile is high: as many as leave room for the tile in registers), and is compiled with that set's
// flags. It may include this file once for each precision.
//
// Nothing but raw pointers and builtins may stand here (intrinsics are always inlined): an inline
// function of the standard library, compiled here for a newer machine, could be the copy that the
// linker keeps for everyone.

#if defined(__AVX2__)
#include <immintrin.h>
#endif

#include "kernels.hpp"

/// Loops about arrays that are to stay in registers must not be left as loops.
#define CAIRN_UNROLL _Pragma("GCC unroll 8")

namespace cairn::block::CAIRN_KERNEL_SET {
namespace {

constexpr int kWidth = CAIRN_KERNEL_WIDTH;
#if CAIRN_KERNEL_SINGLE
typedef float Real;
typedef int Integer;
constexpr Real kLargestPivot = 3.4e38f;
#else
typedef double Real;
typedef long long Integer;
constexpr Real kLargestPivot = 1.7e308;
#endif
typedef Real Vec __attribute__((vector_size(kWidth * sizeof(Real))));
typedef Real LooseVec __attribute__((vector_size(kWidth * sizeof(Real)), aligned(sizeof(Real))));

// What most of the arithmetic is done in, rows of a tile: on machines whose registers hold twice as
// many numbers as a vector, two of them. These begin where a vector may.
#if CAIRN_KERNEL_SINGLE && defined(__AVX512F__)
constexpr int kWide = 2 * kWidth;
typedef Real Wide __attribute__((vector_size(kWide * sizeof(Real))));
typedef Real WideAtVec
    __attribute__((vector_size(kWide * sizeof(Real)), aligned(kWidth * sizeof(Real))));
#else
constexpr int kWide = kWidth;
typedef Vec Wide, WideAtVec;
#endif

template <class T = Vec>
inline __attribute__((always_inline)) T load(const Real* p) {
  if constexpr (sizeof(T) == sizeof(Vec)) {
    return *reinterpret_cast<const Vec*>(p);
  } else {
    return *reinterpret_cast<const WideAtVec*>(p);
  }
}
template <class T>
inline __attribute__((always_inline)) void store(Real* p, T v) {
  if constexpr (sizeof(T) == sizeof(Vec)) {
    *reinterpret_cast<Vec*>(p) = v;
  } else {
    *reinterpret_cast<WideAtVec*>(p) = v;
  }
}
inline __attribute__((always_inline)) Vec load_loose(const Real* p) {
  return *reinterpret_cast<const LooseVec*>(p);
}
inline __attribute__((always_inline)) void store_loose(Real* p, Vec v) {
  *reinterpret_cast<LooseVec*>(p) = v;
}
template <class T = Vec>
inline __attribute__((always_inline)) T broadcast(Real value) {
  return value - T{};  // + would have to turn -0 into 0
}

constexpr int min(int a, int b) { return a < b ? a : b; }

typedef Integer Mask __attribute__((vector_size(kWidth * sizeof(Real))));
inline __attribute__((always_inline)) Mask lanes() {
  Mask numbers{};
  CAIRN_UNROLL
  for (int k = 0; k < kWidth; ++k) numbers[k] = k;
  return numbers;
}
/// Lane j of v in all lanes; j is known when compiling, once the loops about it are unrolled.
inline __attribute__((always_inline)) Vec lane(Vec v, int j) {
#if defined(__clang__)
  return broadcast(v[j]);
#else
  return __builtin_shuffle(v, Mask{} + j);
#endif
}
inline __attribute__((always_inline)) Vec roots(Vec v) {
#if CAIRN_KERNEL_SINGLE && defined(__AVX2__)
  return _mm256_sqrt_ps(v);
#elif defined(__AVX512F__)
  return _mm512_maskz_sqrt_pd(0xff, v);  // GCC 12 warns of its own header at the plain one
#elif defined(__AVX2__)
  return _mm256_sqrt_pd(v);
#else
  for (int k = 0; k < kWidth; ++k)
    v[k] = CAIRN_KERNEL_SINGLE ? __builtin_sqrtf(v[k]) : __builtin_sqrt(v[k]);
  return v;
#endif
}
/// v with its lane j taken from other.
inline __attribute__((always_inline)) Vec with_lane(Vec v, Vec other, int j) {
  return lanes() == j ? other : v;
}
/// v with zeros before its lane j.
inline __attribute__((always_inline)) Vec from_lane(Vec v, int j) {
  return lanes() < j ? Vec{} : v;
}

template <int N>
struct Number {
  static constexpr int value = N;
};

/// Σ of the lanes, pairwise.
inline __attribute__((always_inline)) Real total(Vec v) {
  alignas(64) Real part[kWidth];
  store(part, v);
  for (int half = kWidth / 2; half > 0; half /= 2) {
    for (int k = 0; k < half; ++k) part[k] += part[k + half];
  }
  return part[0];
}

/// target[k] += source[k], or = source[k], for k = 0 … length-1: the rest of a vector under a mask
/// where the machine has one, since most stretches are shorter than a vector.
inline __attribute__((always_inline)) void add(Real* target, const Real* source, int length) {
  int k = 0;
  for (; k + kWidth <= length; k += kWidth)
    store_loose(target + k, load_loose(target + k) + load_loose(source + k));
#if defined(__AVX512F__)
  const __mmask8 mask = static_cast<__mmask8>((1u << (length - k)) - 1u);
#if CAIRN_KERNEL_SINGLE
  _mm256_mask_storeu_ps(target + k, mask,
                        _mm256_add_ps(_mm256_maskz_loadu_ps(mask, target + k),
                                      _mm256_maskz_loadu_ps(mask, source + k)));
#else
  _mm512_mask_storeu_pd(target + k, mask,
                        _mm512_add_pd(_mm512_maskz_loadu_pd(mask, target + k),
                                      _mm512_maskz_loadu_pd(mask, source + k)));
#endif
#else
  for (; k < length; ++k) target[k] += source[k];
#endif
}
inline __attribute__((always_inline)) void copy(Real* target, const Real* source, int length) {
  int k = 0;
  for (; k + kWidth <= length; k += kWidth) store_loose(target + k, load_loose(source + k));
#if defined(__AVX512F__)
  const __mmask8 mask = static_cast<__mmask8>((1u << (length - k)) - 1u);
#if CAIRN_KERNEL_SINGLE
  _mm256_mask_storeu_ps(target + k, mask, _mm256_maskz_loadu_ps(mask, source + k));
#else
  _mm512_mask_storeu_pd(target + k, mask, _mm512_maskz_loadu_pd(mask, source + k));
#endif
#else
  for (; k < length; ++k) target[k] = source[k];
#endif
}
#if CAIRN_KERNEL_SINGLE
/// Rounded: a column of a block of H, mostly shorter than a vector.
inline __attribute__((always_inline)) void copy(Real* target, const double* source, int length) {
  int k = 0;
#if defined(__AVX512F__)
  for (; k < length; k += 8) {
    const int left = length - k;
    const __mmask8 mask = static_cast<__mmask8>(left < 8 ? (1u << left) - 1u : 0xffu);
    _mm256_mask_storeu_ps(target + k, mask,
                          _mm512_maskz_cvtpd_ps(0xff, _mm512_maskz_loadu_pd(mask, source + k)));
  }
#endif
  for (; k < length; ++k) target[k] = static_cast<Real>(source[k]);
}
#endif

/// Vectors of rows that a tile is high.
constexpr int kTileVectors = CAIRN_KERNEL_TILE;
/// Columns that a tile is wide, and columns of a panel that are factored together.
constexpr int kTileColumns = kWidth;
static_assert((kWidth == 8 || kWidth == 4) && (kTileVectors == 3 || kTileVectors == 1));

/// visit(Number<N>) for N = 1 … kWidth.
template <class Visit>
inline __attribute__((always_inline)) void with_columns(int N, Visit visit) {
  if constexpr (kWidth == 8) {
    switch (N) {
      case 8:
        return visit(Number<8>{});
      case 7:
        return visit(Number<7>{});
      case 6:
        return visit(Number<6>{});
      case 5:
        return visit(Number<5>{});
      default:
        break;
    }
  }
  switch (N) {
    case 4:
      return visit(Number<4>{});
    case 3:
      return visit(Number<3>{});
    case 2:
      return visit(Number<2>{});
    default:
      return visit(Number<1>{});
  }
}

template <class T>
constexpr int kLanes = static_cast<int>(sizeof(T) / sizeof(Real));

/// visit(T{}, vectors, row) for the rows [row, row_end), as high tiles as there are: of T = Wide,
/// and for a last vector where that is half of one, of Vec.
template <class Visit>
inline __attribute__((always_inline)) void for_each_tile(int row, int row_end, Visit visit) {
  while (row + kWide <= row_end) {
    const int vectors = min(kTileVectors, (row_end - row) / kWide);
    visit(Wide{}, vectors, row);
    row += vectors * kWide;
  }
  if constexpr (kWide != kWidth) {
    if (row < row_end) visit(Vec{}, 1, row);
  }
}

/// C = -A Bᵀ on a tile of V vectors of rows and N columns; A: rows × K, B: N rows × K, all
/// column-major.
template <class T, int V, int N>
inline __attribute__((always_inline)) void tile(int K, const Real* A, std::int64_t lda,
                                                const Real* B, std::int64_t ldb, Real* C,
                                                std::int64_t ldc) {
  T sum[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) sum[n][v] = T{};
  }
  for (int k = 0; k < K; ++k) {
    T a[V];
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) a[v] = load<T>(A + k * lda + v * kLanes<T>);
    const Real* b = B + k * ldb;
    CAIRN_UNROLL
    for (int n = 0; n < N; ++n) {
      const T bn = broadcast<T>(b[n]);
      CAIRN_UNROLL
      for (int v = 0; v < V; ++v) sum[n][v] -= a[v] * bn;
    }
  }
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) store(C + n * ldc + v * kLanes<T>, sum[n][v]);
  }
}

/// The same for V and N not known when compiling.
template <class T>
void tile(int vectors, int columns, int K, const Real* A, std::int64_t lda, const Real* B,
          std::int64_t ldb, Real* C, std::int64_t ldc) {
  with_columns(columns, [&](auto n) {
    constexpr int N = decltype(n)::value;
    if (vectors == 3) return tile<T, 3, N>(K, A, lda, B, ldb, C, ldc);
    if (vectors == 2) return tile<T, 2, N>(K, A, lda, B, ldb, C, ldc);
    return tile<T, 1, N>(K, A, lda, B, ldb, C, ldc);
  });
}

// --- assemble ---

void assemble(const Assembly* entries, int count, const double* values, Real* panels, Real* panel,
              std::int64_t size) {
  for (std::int64_t k = 0; k < size; k += kWidth) store(panel + k, Vec{});
  for (const Assembly* entry = entries; entry < entries + count; ++entry) {
    const double* source = values + entry->source;
    Real* target = panels + entry->target;
    if (entry->transpose) {
      for (int c = 0; c < entry->columns; ++c) {
        for (int r = 0; r < entry->rows; ++r)
          target[static_cast<std::int64_t>(r) * entry->stride + c] = static_cast<Real>(*source++);
      }
    } else {
      for (int c = 0; c < entry->columns; ++c) {
        copy(target, source, entry->rows);
        source += entry->rows;
        target += entry->stride;
      }
    }
  }
}

// --- factor_panel ---

/// sum += A B, or -= with `kMinus`: V vectors of rows and N columns; B's row k and column n is at
/// k · row_step + n · column_step.
template <bool kMinus, int V, int N, class T>
inline __attribute__((always_inline)) void accumulate(T (&sum)[N][V], int K, const Real* A,
                                                      std::int64_t lda, const Real* B,
                                                      std::int64_t row_step,
                                                      std::int64_t column_step) {
  for (int k = 0; k < K; ++k) {
    T a[V];
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) a[v] = load<T>(A + k * lda + v * kLanes<T>);
    const Real* b = B + k * row_step;
    CAIRN_UNROLL
    for (int n = 0; n < N; ++n) {
      const T bn = broadcast<T>(b[n * column_step]);
      CAIRN_UNROLL
      for (int v = 0; v < V; ++v) {
        if constexpr (kMinus) {
          sum[n][v] -= a[v] * bn;
        } else {
          sum[n][v] += a[v] * bn;
        }
      }
    }
  }
}

/// Columns [begin, begin + N) in V vectors of rows from row `begin` down, the diagonal block among
/// them: subtracts the columns [from, begin), and factors, all in registers. Columns are scaled by
/// their pivots while factoring (L D Lᵀ) and by the roots of them at the end: a root in each step
/// would double the wait for the next pivot. Writes 1 / L_jj. Returns -1, or the first column of
/// the N that has no positive pivot, and what follows it is then worthless.
template <int V, int N>
__attribute__((noinline)) int factor_top(Real* panel, std::int64_t stride, int from, int begin,
                                         Real* reciprocal) {
  Real* block = panel + begin * stride + begin;
  Vec x[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) x[n][v] = load(block + n * stride + v * kWidth);
  }
  const Real* left = panel + from * stride + begin;
  accumulate<true, V, N>(x, begin - from, left, stride, left, stride, 1);

  alignas(64) Real top[kWidth];
  Vec pivots = broadcast(1.0);
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    store(top, x[j][0]);
    const Vec inverse = Real{1} / lane(x[j][0], j);
    pivots = with_lane(pivots, x[j][0], j);
    Vec scaled[V];
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) scaled[v] = x[j][v] * inverse;
    CAIRN_UNROLL
    for (int k = j + 1; k < N; ++k) {
      const Vec l = broadcast(top[k]);
      CAIRN_UNROLL
      for (int v = 0; v < V; ++v) x[k][v] -= scaled[v] * l;
    }
  }
  store(top, pivots);
  int failed = -1;
  CAIRN_UNROLL
  for (int j = N - 1; j >= 0; --j) {
    if (!(top[j] > 0.0) || top[j] > kLargestPivot) failed = j;
  }
  store(top, Real{1} / roots(pivots));
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    reciprocal[j] = top[j];
    const Vec factor = broadcast(top[j]);
    // Above the diagonal: zero, so that a solve may take whole vectors.
    store(block + j * stride, from_lane(x[j][0] * factor, j));
    CAIRN_UNROLL
    for (int v = 1; v < V; ++v) store(block + j * stride + v * kWidth, x[j][v] * factor);
  }
  return failed;
}

/// X ← (X - left) L⁻ᵀ in columns [begin, begin + N) of V vectors of rows, whose diagonal block in
/// the panel is done: `left` are the columns [first, begin). X is a panel's own rows below, or
/// another matrix.
template <class T, int V, int N>
__attribute__((noinline)) void solve_from_right(Real* X, std::int64_t ldx, const Real* panel,
                                                std::int64_t stride, int first, int begin,
                                                const Real* reciprocal) {
  Real* block = X + begin * ldx;
  const Real* L = panel + begin * stride + begin;
  T x[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) x[n][v] = load<T>(block + n * ldx + v * kLanes<T>);
  }
  accumulate<true, V, N>(x, begin - first, X + first * ldx, ldx, panel + first * stride + begin,
                         stride, 1);
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    const T inverse = broadcast<T>(reciprocal[j]);
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) {
      x[j][v] *= inverse;
      store(block + j * ldx + v * kLanes<T>, x[j][v]);
    }
    CAIRN_UNROLL
    for (int k = j + 1; k < N; ++k) {
      const T l = broadcast<T>(L[j * stride + k]);
      CAIRN_UNROLL
      for (int v = 0; v < V; ++v) x[k][v] -= x[j][v] * l;
    }
  }
}

/// The same for V not known when compiling.
template <int N, class T>
inline __attribute__((always_inline)) void solve_from_right(T, int vectors, Real* X,
                                                            std::int64_t ldx, const Real* panel,
                                                            std::int64_t stride, int first,
                                                            int begin, const Real* reciprocal) {
  if constexpr (kTileVectors == 3) {
    if (vectors == 3)
      return solve_from_right<T, 3, N>(X, ldx, panel, stride, first, begin, reciprocal);
    if (vectors == 2)
      return solve_from_right<T, 2, N>(X, ldx, panel, stride, first, begin, reciprocal);
  }
  solve_from_right<T, 1, N>(X, ldx, panel, stride, first, begin, reciprocal);
}

template <int N>
void factor_rows(Real* panel, std::int64_t stride, int from, int begin, int row, int row_end,
                 const Real* reciprocal) {
  for_each_tile(row, row_end, [&](auto vector, int vectors, int at) {
    solve_from_right<N>(vector, vectors, panel + at, stride, panel, stride, from, begin,
                        reciprocal);
  });
}

template <int N>
int factor_columns(Real* panel, std::int64_t stride, int from, int begin, int row_end) {
  Real reciprocal[kWidth];
  const int vectors = min((row_end - begin) / kWidth, kTileVectors);
  int failed = -1;
  if constexpr (kTileVectors == 3) {
    failed = vectors == 3   ? factor_top<3, N>(panel, stride, from, begin, reciprocal)
             : vectors == 2 ? factor_top<2, N>(panel, stride, from, begin, reciprocal)
                            : factor_top<1, N>(panel, stride, from, begin, reciprocal);
  } else {
    failed = factor_top<1, N>(panel, stride, from, begin, reciprocal);
  }
  factor_rows<N>(panel, stride, from, begin, begin + vectors * kWidth, row_end, reciprocal);
  return failed < 0 ? -1 : begin + failed;
}

int factor_panel(Real* panel, std::int64_t stride, int from, int first, int last, int row_end) {
  int failed = -1;
  for (int begin = first; begin < last; begin += kWidth) {
    int column = -1;
    with_columns(min(kWidth, last - begin), [&](auto N) {
      column = factor_columns<decltype(N)::value>(panel, stride, from, begin, row_end);
    });
    if (failed < 0) failed = column;
  }
  return failed;
}

/// The reciprocals of the pivots of columns [begin, begin + N).
inline __attribute__((always_inline)) Vec reciprocals(const Real* diagonal, std::int64_t stride,
                                                      int N) {
  Vec pivots = broadcast(1.0);
  for (int j = 0; j < N; ++j) pivots[j] = diagonal[j * stride + j];
  return Real{1} / pivots;
}

void factor_rows(Real* panel, std::int64_t stride, int from, int first, int last, int row_begin,
                 int row_end) {
  for (int begin = first; begin < last; begin += kWidth) {
    const int count = min(kWidth, last - begin);
    alignas(64) Real reciprocal[kWidth];
    store(reciprocal, reciprocals(panel + begin * stride + begin, stride, count));
    with_columns(count, [&](auto N) {
      factor_rows<decltype(N)::value>(panel, stride, from, begin, row_begin, row_end, reciprocal);
    });
  }
}

// --- subtract ---

/// Columns of K that are subtracted before the next: so many of a tile of rows stay in a cache
/// while all columns of J take them.
constexpr int kDepth = 256;

/// C -= A Bᵀ on a tile of V vectors of rows and N columns; all with the same leading dimension.
template <class T, int V, int N>
__attribute__((noinline)) void subtract_product(int K, const Real* A, const Real* B, Real* C,
                                                std::int64_t stride) {
  T c[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) c[n][v] = load<T>(C + n * stride + v * kLanes<T>);
  }
  accumulate<true, V, N>(c, K, A, stride, B, stride, 1);
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) store(C + n * stride + v * kLanes<T>, c[n][v]);
  }
}

template <class T, int N>
void subtract_product(int vectors, int K, const Real* A, const Real* B, Real* C,
                      std::int64_t stride) {
  if constexpr (kTileVectors == 3) {
    if (vectors == 3) return subtract_product<T, 3, N>(K, A, B, C, stride);
    if (vectors == 2) return subtract_product<T, 2, N>(K, A, B, C, stride);
  }
  subtract_product<T, 1, N>(K, A, B, C, stride);
}

void subtract(Real* panel, std::int64_t stride, int first, int last, int row_begin, int row_end) {
  for (int k = 0; k < first; k += kDepth) {
    const Real* left = panel + k * stride;
    const int depth = min(kDepth, first - k);
    for (int column = first; column < last; column += kTileColumns) {
      with_columns(min(kTileColumns, last - column), [&](auto N) {
        for_each_tile(row_begin < column ? column : row_begin, row_end,
                      [&](auto vector, int vectors, int row) {
                        subtract_product<decltype(vector), decltype(N)::value>(
                            vectors, depth, left + row, left + column,
                            panel + column * stride + row, stride);
                      });
      });
    }
  }
}

// --- update ---

void update(const Real* panel, std::int64_t stride, int columns, int m, Real* U, int row_begin,
            int row_end) {
  const int shift = columns / 8 * 8;
  const std::int64_t ldu = stride - shift;
  for_each_tile(row_begin, row_end, [&](auto vector, int vectors, int row) {
    using T = decltype(vector);
    const int last_column = min(m, row + vectors * kLanes<T>);  // up to the tile's last row
    for (int column = columns; column < last_column; column += kTileColumns) {
      tile<T>(vectors, min(kTileColumns, last_column - column), columns, panel + row, stride,
              panel + column, stride, U + (column - columns) * ldu + (row - shift), ldu);
    }
  });
}

// --- extend_add ---

#if CAIRN_KERNEL_SINGLE && defined(__AVX2__) && !defined(__AVX512F__)
/// For each set of eight rows, as bits: the packed number that goes to each of them.
struct Expansion {
  int from[256][8];
};
constexpr Expansion expansion() {
  Expansion table{};
  for (int bits = 0; bits < 256; ++bits) {
    int next = 0;
    for (int row = 0; row < 8; ++row) table.from[bits][row] = (bits >> row & 1) != 0 ? next++ : 7;
  }
  return table;
}
alignas(32) constexpr Expansion kExpansion = expansion();
/// From place 8 - n on: the first n of eight lanes.
alignas(32) constexpr int kFirst[16] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0};
#elif defined(__AVX2__) && !defined(__AVX512F__)
/// For each set of four rows, as bits: the halves of packed doubles that go to each of them.
struct Expansion {
  int halves[16][8];
};
constexpr Expansion expansion() {
  Expansion table{};
  for (int bits = 0; bits < 16; ++bits) {
    int next = 0;
    for (int row = 0; row < 4; ++row) {
      const int from = (bits >> row & 1) != 0 ? next++ : 3;
      table.halves[bits][2 * row] = 2 * from;
      table.halves[bits][2 * row + 1] = 2 * from + 1;
    }
  }
  return table;
}
alignas(32) constexpr Expansion kExpansion = expansion();
/// The first so many of four lanes.
alignas(32) constexpr long long kFirst[5][4] = {
    {0, 0, 0, 0}, {-1, 0, 0, 0}, {-1, -1, 0, 0}, {-1, -1, -1, 0}, {-1, -1, -1, -1}};
#endif

/// target[k] += the next of source, for each bit k of mask: eight rows.
inline __attribute__((always_inline)) void add_spread(Real* target, const Real* source,
                                                      unsigned mask,
                                                      [[maybe_unused]] unsigned packed_mask) {
#if CAIRN_KERNEL_SINGLE && defined(__AVX512F__)
  __m256 packed = _mm256_maskz_loadu_ps(static_cast<__mmask8>(packed_mask), source);
  asm("" : "+v"(packed));  // as below
  store<Vec>(target, load(target) + _mm256_maskz_expand_ps(static_cast<__mmask8>(mask), packed));
#elif CAIRN_KERNEL_SINGLE && defined(__AVX2__)
  // Lanes that are not loaded are zero; a row without a source takes the last of them: of eight
  // rows with eight sources there is none.
  const int next = __builtin_popcount(mask);
  const __m256i loaded = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kFirst + 8 - next));
  const __m256i rows = _mm256_load_si256(reinterpret_cast<const __m256i*>(kExpansion.from[mask]));
  const __m256 packed = _mm256_maskload_ps(source, loaded);
  store<Vec>(target, load(target) + _mm256_permutevar8x32_ps(packed, rows));
#elif defined(__AVX512F__)
  __m512d packed = _mm512_maskz_loadu_pd(static_cast<__mmask8>(packed_mask), source);
  asm("" : "+v"(packed));  // to expand from memory is many times slower on some machines
  store<Vec>(target, load(target) + _mm512_maskz_expand_pd(static_cast<__mmask8>(mask), packed));
#elif defined(__AVX2__)
  for (int half = 0; half < 8; half += kWidth, mask >>= kWidth) {
    const unsigned bits = mask & 15u;
    if (bits == 0) continue;
    const int next = __builtin_popcount(bits);
    // Lanes that are not loaded are zero; a row without a source takes the last of them.
    const __m256i rows =
        _mm256_load_si256(reinterpret_cast<const __m256i*>(kExpansion.halves[bits]));
    const __m256i loaded = _mm256_load_si256(reinterpret_cast<const __m256i*>(kFirst[next]));
    const __m256 packed = _mm256_castpd_ps(_mm256_maskload_pd(source, loaded));
    const __m256d spread = _mm256_castps_pd(_mm256_permutevar8x32_ps(packed, rows));
    store<Vec>(target + half, load(target + half) + spread);
    source += next;
  }
#else
  for (int half = 0; half < 8; half += kWidth, mask >>= kWidth) {
    unsigned bits = mask & ((1u << kWidth) - 1u);
    if (bits == (1u << kWidth) - 1u) {
      store(target + half, load(target + half) + load_loose(source));
      source += kWidth;
      continue;
    }
    for (; bits != 0; bits &= bits - 1) target[half + __builtin_ctz(bits)] += *source++;
  }
#endif
}

void extend_add(const Spread* spreads, int count, int first, int last, const Real* child,
                std::int64_t child_stride, Real* parent, std::int64_t parent_stride) {
  const Spread* const end = spreads + count;
  while (spreads + 1 < end && spreads[1].source <= first) ++spreads;
  for (; spreads < end && spreads->source < last; ++spreads) {
    int column = spreads->source;
    for (unsigned bits = spreads->mask; bits != 0; bits &= bits - 1, ++column) {
      if (column < first || column >= last) continue;
      const Real* source = child + column * child_stride;
      Real* target = parent + (spreads->target + __builtin_ctz(bits)) * parent_stride;
      // From the vector that holds the diagonal: what is above it is unused.
      for (const Spread* s = spreads; s < end; ++s) {
        // A large child has left the caches, and columns are too far apart for the machine to see.
        __builtin_prefetch(source + s->source + 2 * child_stride);
        add_spread(target + s->target, source + s->source, s->mask, s->packed);
      }
    }
  }
}

// --- solve ---

/// x ← L⁻¹ x for N columns, their diagonal block at the first vector of `block`; the rows below,
/// up to `stride`, are updated.
template <int N>
__attribute__((noinline)) void forward_columns(const Real* block, std::int64_t stride, int rows,
                                               Real* x) {
  alignas(64) Real inverse[kWidth];
  store(inverse, reciprocals(block, stride, N));
  Vec top = load(x);
  Vec factor[N];
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    const Real xj = top[j] * inverse[j];
    factor[j] = broadcast(xj);
    top -= load(block + j * stride) * factor[j];
    inverse[j] = xj;
  }
  store(x, top);
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) x[j] = inverse[j];
  for (int i = kWidth; i < rows; i += kWidth) {
    Vec sum = load(x + i);
    CAIRN_UNROLL
    for (int j = 0; j < N; ++j) sum -= load(block + j * stride + i) * factor[j];
    store(x + i, sum);
  }
}

/// x ← L⁻ᵀ x for the same columns: the rows below are only read.
template <int N>
__attribute__((noinline)) void backward_columns(const Real* block, std::int64_t stride, int rows,
                                                Real* x) {
  Vec sums[N] = {};
  for (int i = kWidth; i < rows; i += kWidth) {
    const Vec xi = load(x + i);
    CAIRN_UNROLL
    for (int j = 0; j < N; ++j) sums[j] += load(block + j * stride + i) * xi;
  }
  // Rows of the first vector that are below the diagonal block: its own are set to zero first.
  alignas(64) Real top[kWidth];
  store(top, load(x));
  Real own[N];
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    own[j] = top[j];
    top[j] = 0.0;
  }
  if constexpr (N < kWidth) {
    const Vec rest = load(top);
    CAIRN_UNROLL
    for (int j = 0; j < N; ++j) sums[j] += load(block + j * stride) * rest;
  }
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) own[j] -= total(sums[j]);
  alignas(64) Real inverse[kWidth];
  store(inverse, reciprocals(block, stride, N));
  CAIRN_UNROLL
  for (int j = N - 1; j >= 0; --j) {
    own[j] *= inverse[j];
    CAIRN_UNROLL
    for (int k = 0; k < j; ++k) own[k] -= block[k * stride + j] * own[j];
  }
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) x[j] = own[j];
}

void forward(const Real* panel, std::int64_t stride, int columns, Real* own, const Run* runs,
             int count, Real* vector, Real* front) {
  copy(front, own, columns);
  for (int i = columns; i < stride; ++i) front[i] = 0.0;
  for (int begin = 0; begin < columns; begin += kWidth) {
    with_columns(min(kWidth, columns - begin), [&](auto N) {
      forward_columns<decltype(N)::value>(panel + begin * stride + begin, stride,
                                          static_cast<int>(stride) - begin, front + begin);
    });
  }
  copy(own, front, columns);
  for (int r = 0; r < count; ++r)
    add(vector + runs[r].source, front + runs[r].target, runs[r].length);
}

void backward(const Real* panel, std::int64_t stride, int columns, int m, Real* own,
              const Run* runs, int count, const Real* vector, Real* front) {
  copy(front, own, columns);
  for (int r = 0; r < count; ++r)
    copy(front + runs[r].target, vector + runs[r].source, runs[r].length);
  for (int i = m; i < stride; ++i) front[i] = 0.0;
  for (int begin = (columns - 1) / kWidth * kWidth; begin >= 0; begin -= kWidth) {
    with_columns(min(kWidth, columns - begin), [&](auto N) {
      backward_columns<decltype(N)::value>(panel + begin * stride + begin, stride,
                                           static_cast<int>(stride) - begin, front + begin);
    });
  }
  copy(own, front, columns);
}

#if !CAIRN_KERNEL_SINGLE
#include "chain_kernels_body.hpp"
#include "inverse_kernels_body.hpp"
#endif

constexpr FrontKernels<Real> kFrontKernels{.assemble = &assemble,
                                           .factor_panel = &factor_panel,
                                           .factor_rows = &factor_rows,
                                           .subtract = &subtract,
                                           .update = &update,
                                           .extend_add = &extend_add,
                                           .forward = &forward,
                                           .backward = &backward};

}  // namespace

#if CAIRN_KERNEL_SINGLE
extern const FrontKernels<Real> kernels;
constinit const FrontKernels<Real> kernels = kFrontKernels;
#else
extern const Kernels kernels;
constinit const Kernels kernels = [] {
  Kernels all{};
  static_cast<FrontKernels<Real>&>(all) = kFrontKernels;
  all.name = CAIRN_KERNEL_NAME;
  all.lanes = kWidth;
  all.single = &CAIRN_KERNEL_SINGLE_SET::kernels;
  all.chains[0] = chain_kernels<3>();
  all.chains[1] = chain_kernels<6>();
  all.forward_many = &forward_many;
  all.backward_many = &backward_many;
  all.invert_pivots = &invert_pivots;
  all.transform_rows = &transform_rows;
  all.inverse_rows = &inverse_rows;
  all.inverse_pivots = &inverse_pivots;
  all.gather = &gather;
  all.mirror = &mirror;
  return all;
}();
#endif

}  // namespace cairn::block::CAIRN_KERNEL_SET
