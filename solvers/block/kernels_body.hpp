// SPDX-License-Identifier: BSD-3-Clause
//
// The kernels of kernels.hpp, compiled once for each instruction set: the including file sets
// CAIRN_KERNEL_SET and CAIRN_KERNEL_NAME (a name), CAIRN_KERNEL_WIDTH (doubles in a vector) and
// CAIRN_KERNEL_HALVES (1 where a vector takes two registers), and is compiled with that set's
// flags.
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
inline __attribute__((always_inline)) Vec broadcast(double value) {
  return value - Vec{};  // + would have to turn -0 into 0
}

constexpr int min(int a, int b) { return a < b ? a : b; }

typedef long long Mask __attribute__((vector_size(kWidth * sizeof(double))));
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
#if defined(__AVX512F__)
  return _mm512_maskz_sqrt_pd(0xff, v);  // GCC 12 warns of its own header at the plain one
#elif defined(__AVX2__)
  return _mm256_sqrt_pd(v);
#else
  for (int k = 0; k < kWidth; ++k) v[k] = __builtin_sqrt(v[k]);
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
inline __attribute__((always_inline)) double total(Vec v) {
  alignas(64) double part[kWidth];
  store(part, v);
  for (int half = kWidth / 2; half > 0; half /= 2) {
    for (int k = 0; k < half; ++k) part[k] += part[k + half];
  }
  return part[0];
}

/// target[k] += source[k], or = source[k], for k = 0 … length-1: the rest of a vector under a mask
/// where the machine has one, since most stretches are shorter than a vector.
inline __attribute__((always_inline)) void add(double* target, const double* source, int length) {
  int k = 0;
  for (; k + kWidth <= length; k += kWidth)
    store_loose(target + k, load_loose(target + k) + load_loose(source + k));
#if defined(__AVX512F__)
  const __mmask8 mask = static_cast<__mmask8>((1u << (length - k)) - 1u);
  _mm512_mask_storeu_pd(target + k, mask,
                        _mm512_add_pd(_mm512_maskz_loadu_pd(mask, target + k),
                                      _mm512_maskz_loadu_pd(mask, source + k)));
#else
  for (; k < length; ++k) target[k] += source[k];
#endif
}
inline __attribute__((always_inline)) void copy(double* target, const double* source, int length) {
  int k = 0;
  for (; k + kWidth <= length; k += kWidth) store_loose(target + k, load_loose(source + k));
#if defined(__AVX512F__)
  const __mmask8 mask = static_cast<__mmask8>((1u << (length - k)) - 1u);
  _mm512_mask_storeu_pd(target + k, mask, _mm512_maskz_loadu_pd(mask, source + k));
#else
  for (; k < length; ++k) target[k] = source[k];
#endif
}

/// Vectors of rows that a tile is high: as many as leave room for the tile in registers. A machine
/// of 128 bits has half the room: it takes two registers for a vector of four.
constexpr int kTileVectors = CAIRN_KERNEL_HALVES ? 1 : 3;
/// Columns that a tile is wide, and columns of a panel that are factored together.
constexpr int kTileColumns = kWidth;
static_assert(kWidth == 8 || kWidth == 4);

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

/// C = -A Bᵀ on a tile of V vectors of rows and N columns; A: rows × K, B: N rows × K, all
/// column-major.
template <int V, int N>
inline __attribute__((always_inline)) void tile(int K, const double* A, std::int64_t lda,
                                                const double* B, std::int64_t ldb, double* C,
                                                std::int64_t ldc) {
  Vec sum[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) sum[n][v] = Vec{};
  }
  for (int k = 0; k < K; ++k) {
    Vec a[V];
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) a[v] = load(A + k * lda + v * kWidth);
    const double* b = B + k * ldb;
    CAIRN_UNROLL
    for (int n = 0; n < N; ++n) {
      const Vec bn = broadcast(b[n]);
      CAIRN_UNROLL
      for (int v = 0; v < V; ++v) sum[n][v] -= a[v] * bn;
    }
  }
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) store(C + n * ldc + v * kWidth, sum[n][v]);
  }
}

/// The same for V and N not known when compiling.
void tile(int vectors, int columns, int K, const double* A, std::int64_t lda, const double* B,
          std::int64_t ldb, double* C, std::int64_t ldc) {
  with_columns(columns, [&](auto n) {
    constexpr int N = decltype(n)::value;
    if (vectors == 3) return tile<3, N>(K, A, lda, B, ldb, C, ldc);
    if (vectors == 2) return tile<2, N>(K, A, lda, B, ldb, C, ldc);
    return tile<1, N>(K, A, lda, B, ldb, C, ldc);
  });
}

// --- assemble ---

void assemble(const Assembly* entries, int count, const double* values, double* panels,
              double* panel, std::int64_t size) {
  for (std::int64_t k = 0; k < size; k += kWidth) store(panel + k, Vec{});
  for (const Assembly* entry = entries; entry < entries + count; ++entry) {
    const double* source = values + entry->source;
    double* target = panels + entry->target;
    if (entry->transpose) {
      for (int c = 0; c < entry->columns; ++c) {
        for (int r = 0; r < entry->rows; ++r)
          target[static_cast<std::int64_t>(r) * entry->stride + c] = *source++;
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
template <bool kMinus, int V, int N>
inline __attribute__((always_inline)) void accumulate(Vec (&sum)[N][V], int K, const double* A,
                                                      std::int64_t lda, const double* B,
                                                      std::int64_t row_step,
                                                      std::int64_t column_step) {
  for (int k = 0; k < K; ++k) {
    Vec a[V];
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) a[v] = load(A + k * lda + v * kWidth);
    const double* b = B + k * row_step;
    CAIRN_UNROLL
    for (int n = 0; n < N; ++n) {
      const Vec bn = broadcast(b[n * column_step]);
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
/// them: subtracts what is to the left, and factors, all in registers. Columns are scaled by their
/// pivots while factoring (L D Lᵀ) and by the roots of them at the end: a root in each step would
/// double the wait for the next pivot. Writes 1 / L_jj. Returns -1, or the first column of the N
/// that has no positive pivot, and what follows it is then worthless.
template <int V, int N>
__attribute__((noinline)) int factor_top(double* panel, std::int64_t stride, int begin,
                                         double* reciprocal) {
  double* block = panel + begin * stride + begin;
  Vec x[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) x[n][v] = load(block + n * stride + v * kWidth);
  }
  accumulate<true, V, N>(x, begin, panel + begin, stride, panel + begin, stride, 1);

  alignas(64) double top[kWidth];
  Vec pivots = broadcast(1.0);
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    store(top, x[j][0]);
    const Vec inverse = 1.0 / lane(x[j][0], j);
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
    if (!(top[j] > 0.0) || top[j] > 1.7e308) failed = j;
  }
  store(top, 1.0 / roots(pivots));
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
template <int V, int N>
__attribute__((noinline)) void solve_from_right(double* X, std::int64_t ldx, const double* panel,
                                                std::int64_t stride, int first, int begin,
                                                const double* reciprocal) {
  double* block = X + begin * ldx;
  const double* L = panel + begin * stride + begin;
  Vec x[N][V];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) x[n][v] = load(block + n * ldx + v * kWidth);
  }
  accumulate<true, V, N>(x, begin - first, X + first * ldx, ldx, panel + first * stride + begin,
                         stride, 1);
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    const Vec inverse = broadcast(reciprocal[j]);
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) {
      x[j][v] *= inverse;
      store(block + j * ldx + v * kWidth, x[j][v]);
    }
    CAIRN_UNROLL
    for (int k = j + 1; k < N; ++k) {
      const Vec l = broadcast(L[j * stride + k]);
      CAIRN_UNROLL
      for (int v = 0; v < V; ++v) x[k][v] -= x[j][v] * l;
    }
  }
}

template <int N>
void factor_rows(double* panel, std::int64_t stride, int begin, int row, int row_end,
                 const double* reciprocal) {
  for (; row + kTileVectors * kWidth <= row_end; row += kTileVectors * kWidth)
    solve_from_right<kTileVectors, N>(panel + row, stride, panel, stride, 0, begin, reciprocal);
  if constexpr (kTileVectors == 3) {
    const int left = (row_end - row) / kWidth;
    if (left == 2) solve_from_right<2, N>(panel + row, stride, panel, stride, 0, begin, reciprocal);
    if (left == 1) solve_from_right<1, N>(panel + row, stride, panel, stride, 0, begin, reciprocal);
  }
}

template <int N>
int factor_columns(double* panel, std::int64_t stride, int begin, int row_end) {
  double reciprocal[kWidth];
  const int vectors = min((row_end - begin) / kWidth, kTileVectors);
  int failed = -1;
  if constexpr (kTileVectors == 3) {
    failed = vectors == 3   ? factor_top<3, N>(panel, stride, begin, reciprocal)
             : vectors == 2 ? factor_top<2, N>(panel, stride, begin, reciprocal)
                            : factor_top<1, N>(panel, stride, begin, reciprocal);
  } else {
    failed = factor_top<1, N>(panel, stride, begin, reciprocal);
  }
  factor_rows<N>(panel, stride, begin, begin + vectors * kWidth, row_end, reciprocal);
  return failed < 0 ? -1 : begin + failed;
}

int factor_panel(double* panel, std::int64_t stride, int first, int last, int row_end) {
  int failed = -1;
  for (int begin = first; begin < last; begin += kWidth) {
    int column = -1;
    with_columns(min(kWidth, last - begin), [&](auto N) {
      column = factor_columns<decltype(N)::value>(panel, stride, begin, row_end);
    });
    if (failed < 0) failed = column;
  }
  return failed;
}

/// The reciprocals of the pivots of columns [begin, begin + N).
inline __attribute__((always_inline)) Vec reciprocals(const double* diagonal, std::int64_t stride,
                                                      int N) {
  Vec pivots = broadcast(1.0);
  for (int j = 0; j < N; ++j) pivots[j] = diagonal[j * stride + j];
  return 1.0 / pivots;
}

void factor_rows(double* panel, std::int64_t stride, int first, int last, int row_begin,
                 int row_end) {
  for (int begin = first; begin < last; begin += kWidth) {
    const int count = min(kWidth, last - begin);
    alignas(64) double reciprocal[kWidth];
    store(reciprocal, reciprocals(panel + begin * stride + begin, stride, count));
    with_columns(count, [&](auto N) {
      factor_rows<decltype(N)::value>(panel, stride, begin, row_begin, row_end, reciprocal);
    });
  }
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
      tile(vectors, min(kTileColumns, last_column - column), columns, panel + row, stride,
           panel + column, stride, U + (column - columns) * ldu + (row - shift), ldu);
    }
  }
}

// --- extend_add ---

#if defined(__AVX2__) && !defined(__AVX512F__)
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
inline __attribute__((always_inline)) void add_spread(double* target, const double* source,
                                                      unsigned mask,
                                                      [[maybe_unused]] unsigned packed_mask) {
#if defined(__AVX512F__)
  __m512d packed = _mm512_maskz_loadu_pd(static_cast<__mmask8>(packed_mask), source);
  asm("" : "+v"(packed));  // to expand from memory is many times slower on some machines
  store(target, load(target) + _mm512_maskz_expand_pd(static_cast<__mmask8>(mask), packed));
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
    store(target + half, load(target + half) + spread);
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

void extend_add(const Spread* spreads, int count, int first, int last, const double* child,
                std::int64_t child_stride, double* parent, std::int64_t parent_stride) {
  const Spread* const end = spreads + count;
  while (spreads + 1 < end && spreads[1].source <= first) ++spreads;
  for (; spreads < end && spreads->source < last; ++spreads) {
    int column = spreads->source;
    for (unsigned bits = spreads->mask; bits != 0; bits &= bits - 1, ++column) {
      if (column < first || column >= last) continue;
      const double* source = child + column * child_stride;
      double* target = parent + (spreads->target + __builtin_ctz(bits)) * parent_stride;
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
__attribute__((noinline)) void forward_columns(const double* block, std::int64_t stride, int rows,
                                               double* x) {
  alignas(64) double inverse[kWidth];
  store(inverse, reciprocals(block, stride, N));
  Vec top = load(x);
  Vec factor[N];
  CAIRN_UNROLL
  for (int j = 0; j < N; ++j) {
    const double xj = top[j] * inverse[j];
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
__attribute__((noinline)) void backward_columns(const double* block, std::int64_t stride, int rows,
                                                double* x) {
  Vec sums[N] = {};
  for (int i = kWidth; i < rows; i += kWidth) {
    const Vec xi = load(x + i);
    CAIRN_UNROLL
    for (int j = 0; j < N; ++j) sums[j] += load(block + j * stride + i) * xi;
  }
  // Rows of the first vector that are below the diagonal block: its own are set to zero first.
  alignas(64) double top[kWidth];
  store(top, load(x));
  double own[N];
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
  alignas(64) double inverse[kWidth];
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

void forward(const double* panel, std::int64_t stride, int columns, double* own, const Run* runs,
             int count, double* vector, double* front) {
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

void backward(const double* panel, std::int64_t stride, int columns, int m, double* own,
              const Run* runs, int count, const double* vector, double* front) {
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

// --- solve for eight right-hand sides ---

/// Vectors of a row of eight.
constexpr int kRow = 8 / kWidth;

/// y -= L x for N columns: L's rows at `column`, X's and Y's rows are of eight.
template <int N>
inline __attribute__((always_inline)) void subtract_rows(const Vec (&x)[N][kRow],
                                                         const double* column, std::int64_t stride,
                                                         double* y) {
  Vec sum[kRow];
  CAIRN_UNROLL
  for (int v = 0; v < kRow; ++v) sum[v] = load(y + v * kWidth);
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    const Vec l = broadcast(column[n * stride]);
    CAIRN_UNROLL
    for (int v = 0; v < kRow; ++v) sum[v] -= l * x[n][v];
  }
  CAIRN_UNROLL
  for (int v = 0; v < kRow; ++v) store(y + v * kWidth, sum[v]);
}

template <int N>
void forward_rows(const double* panel, std::int64_t stride, int begin, int m, double* front) {
  const double* block = panel + begin * stride;
  Vec x[N][kRow];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    const double* row = block + begin + n;
    const Vec inverse = broadcast(1.0 / row[n * stride]);
    CAIRN_UNROLL
    for (int v = 0; v < kRow; ++v) {
      x[n][v] = load(front + (begin + n) * 8 + v * kWidth);
      CAIRN_UNROLL
      for (int k = 0; k < n; ++k) x[n][v] -= broadcast(row[k * stride]) * x[k][v];
      x[n][v] *= inverse;
      store(front + (begin + n) * 8 + v * kWidth, x[n][v]);
    }
  }
  for (int i = begin + N; i < m; ++i) subtract_rows<N>(x, block + i, stride, front + i * 8);
}

template <int N>
void backward_rows(const double* panel, std::int64_t stride, int begin, int m, double* front) {
  const double* block = panel + begin * stride;
  Vec x[N][kRow];
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < kRow; ++v) x[n][v] = load(front + (begin + n) * 8 + v * kWidth);
  }
  for (int i = begin + N; i < m; ++i) {
    CAIRN_UNROLL
    for (int n = 0; n < N; ++n) {
      const Vec l = broadcast(block[n * stride + i]);
      CAIRN_UNROLL
      for (int v = 0; v < kRow; ++v) x[n][v] -= l * load(front + i * 8 + v * kWidth);
    }
  }
  CAIRN_UNROLL
  for (int n = N - 1; n >= 0; --n) {
    const double* row = block + begin + n;
    const Vec inverse = broadcast(1.0 / row[n * stride]);
    CAIRN_UNROLL
    for (int v = 0; v < kRow; ++v) {
      x[n][v] *= inverse;
      store(front + (begin + n) * 8 + v * kWidth, x[n][v]);
      CAIRN_UNROLL
      for (int k = 0; k < n; ++k) x[k][v] -= broadcast(row[k * stride]) * x[n][v];
    }
  }
}

/// visit(begin, Number<N>) for the columns of a panel, four at a time.
template <class Visit>
inline __attribute__((always_inline)) void four_columns(int begin, int columns, Visit visit) {
  switch (min(4, columns - begin)) {
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

void forward_many(const double* panel, std::int64_t stride, int columns, double* own,
                  const Run* runs, int count, double* vector, double* front) {
  const int below = count > 0 ? runs[count - 1].target + runs[count - 1].length : columns;
  copy(front, own, columns * 8);
  for (int i = columns * 8; i < below * 8; i += kWidth) store(front + i, Vec{});
  for (int begin = 0; begin < columns; begin += 4) {
    four_columns(begin, columns, [&](auto N) {
      forward_rows<decltype(N)::value>(panel, stride, begin, below, front);
    });
  }
  copy(own, front, columns * 8);
  for (int r = 0; r < count; ++r)
    add(vector + std::int64_t{runs[r].source} * 8, front + runs[r].target * 8, runs[r].length * 8);
}

void backward_many(const double* panel, std::int64_t stride, int columns, int m, double* own,
                   const Run* runs, int count, const double* vector, double* front) {
  copy(front, own, columns * 8);
  for (int r = 0; r < count; ++r)
    copy(front + runs[r].target * 8, vector + std::int64_t{runs[r].source} * 8, runs[r].length * 8);
  for (int begin = (columns - 1) / 4 * 4; begin >= 0; begin -= 4) {
    four_columns(begin, columns, [&](auto N) {
      backward_rows<decltype(N)::value>(panel, stride, begin, m, front);
    });
  }
  copy(own, front, columns * 8);
}

// --- selected inversion ---

constexpr int round_up(int rows) { return (rows + 7) / 8 * 8; }

void invert_pivots(const double* panel, std::int64_t stride, int columns, double* V, int row_begin,
                   int row_end) {
  const std::int64_t ldv = round_up(columns);
  for (int k = row_begin; k < min(row_end, columns); ++k) V[k * ldv + k] = 1.0;
  for (int row = row_begin; row < row_end; row += kTileVectors * kWidth) {
    const int vectors = min(kTileVectors, (row_end - row) / kWidth);
    for (int begin = row; begin < columns; begin += kWidth) {
      const int count = min(kWidth, columns - begin);
      alignas(64) double reciprocal[kWidth];
      store(reciprocal, reciprocals(panel + begin * stride + begin, stride, count));
      with_columns(count, [&](auto n) {
        constexpr int N = decltype(n)::value;
        if (vectors == 3) {
          solve_from_right<3, N>(V + row, ldv, panel, stride, row, begin, reciprocal);
        } else if (vectors == 2) {
          solve_from_right<2, N>(V + row, ldv, panel, stride, row, begin, reciprocal);
        } else {
          solve_from_right<1, N>(V + row, ldv, panel, stride, row, begin, reciprocal);
        }
      });
    }
  }
}

/// visit(Number<V>, Number<N>) for a tile of so many vectors and columns.
template <class Visit>
inline __attribute__((always_inline)) void with_tile(int vectors, int columns, Visit visit) {
  with_columns(columns, [&](auto n) {
    if constexpr (kTileVectors == 3) {
      if (vectors == 3) return visit(Number<3>{}, n);
      if (vectors == 2) return visit(Number<2>{}, n);
    }
    return visit(Number<1>{}, n);
  });
}

template <int V, int N>
__attribute__((noinline)) void transform_tile(int K, const double* A, std::int64_t lda,
                                              const double* B, std::int64_t ldb, double* C) {
  Vec sum[N][V] = {};
  accumulate<false, V, N>(sum, K, A, lda, B, ldb, 1);
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) store(C + n * lda + v * kWidth, sum[n][v]);
  }
}

void transform_rows(const double* panel, std::int64_t stride, int columns, const double* V,
                    double* T, int first, int last) {
  const int c8 = round_up(columns);
  for (int row = 0; row < c8; row += kTileVectors * kWidth) {
    const int vectors = min(kTileVectors, (c8 - row) / kWidth);
    // V is upper triangular: its rows from `row` on begin at column `row`.
    const double* A = V + std::int64_t{row} * c8 + row;
    for (int column = first; column < last; column += kTileColumns) {
      const double* B = panel + row * stride + columns + column;
      double* C = T + std::int64_t{column} * c8 + row;
      with_tile(vectors, min(kTileColumns, last - column), [&](auto v, auto n) {
        transform_tile<decltype(v)::value, decltype(n)::value>(columns - row, A, c8, B, stride, C);
      });
    }
  }
}

void inverse_rows(const double* U, std::int64_t stride, int columns, int m, const double* T,
                  double* Z, int row_begin, int row_end) {
  const int shift = columns / 8 * 8;
  const std::int64_t ldu = stride - shift;
  const std::int64_t ldt = round_up(columns);
  for (int row = row_begin; row < row_end; row += kTileVectors * kWidth) {
    const int vectors = min(kTileVectors, (row_end - row) / kWidth);
    for (int column = 0; column < columns; column += kTileColumns) {
      tile(vectors, min(kTileColumns, columns - column), m - columns, U + (row - shift), ldu,
           T + column, ldt, Z + column * stride + row, stride);
    }
  }
}

/// One tile of Z_JJ, at `row` and `column`, to a place of its own.
template <int V, int N>
__attribute__((noinline)) void pivots_tile(const double* VV, const double* T, std::int64_t stride,
                                           int columns, int m, const double* Z, int row, int column,
                                           double* C) {
  const std::int64_t ld = round_up(columns);
  Vec sum[N][V] = {};
  accumulate<false, V, N>(sum, columns - row, VV + row * ld + row, ld, VV + row * ld + column, ld,
                          1);
  accumulate<true, V, N>(sum, m - columns, T + row, ld, Z + column * stride + columns, 1, stride);
  CAIRN_UNROLL
  for (int n = 0; n < N; ++n) {
    CAIRN_UNROLL
    for (int v = 0; v < V; ++v) store(C + (n * V + v) * kWidth, sum[n][v]);
  }
}

void inverse_pivots(const double* V, const double* T, std::int64_t stride, int columns, int m,
                    double* Z, int row_begin, int row_end) {
  for (int row = row_begin; row < row_end; row += kTileVectors * kWidth) {
    const int vectors = min(kTileVectors, (row_end - row) / kWidth);
    const int height = vectors * kWidth;
    const int last_row = min(columns, row + height);
    for (int column = 0; column < last_row; column += kTileColumns) {
      const int width = min(kTileColumns, last_row - column);
      alignas(64) double C[kTileVectors * kWidth * kTileColumns];
      with_tile(vectors, width, [&](auto v, auto n) {
        pivots_tile<decltype(v)::value, decltype(n)::value>(V, T, stride, columns, m, Z, row,
                                                            column, C);
      });
      for (int n = 0; n < width; ++n) {
        for (int i = column + n > row ? column + n : row; i < last_row; ++i) {
          const double z = C[n * height + (i - row)];
          Z[(column + n) * stride + i] = z;
          Z[i * stride + column + n] = z;
        }
      }
    }
  }
}

/// target[0 …] = those of the eight at source whose bit in `mask` is set; `packed_mask` has as many
/// bits, from the lowest on.
inline __attribute__((always_inline)) void take_spread(double* target, const double* source,
                                                       unsigned mask,
                                                       [[maybe_unused]] unsigned packed_mask) {
#if defined(__AVX512F__)
  const __m512d packed = _mm512_maskz_compress_pd(static_cast<__mmask8>(mask), load(source));
  _mm512_mask_storeu_pd(target, static_cast<__mmask8>(packed_mask), packed);
#else
  for (int half = 0; half < 8; half += kWidth, mask >>= kWidth) {
    unsigned bits = mask & ((1u << kWidth) - 1u);
    if (bits == (1u << kWidth) - 1u) {
      store_loose(target, load(source + half));
      target += kWidth;
      continue;
    }
    for (; bits != 0; bits &= bits - 1) *target++ = source[half + __builtin_ctz(bits)];
  }
#endif
}

void gather(const Spread* spreads, int count, int first, int last, int from, double* U,
            std::int64_t child_stride, int lead, const double* parent, std::int64_t parent_stride) {
  const Spread* const end = spreads + count;
  const Spread* begin = spreads;
  while (begin + 1 < end && begin[1].source <= from) ++begin;
  while (spreads + 1 < end && spreads[1].source <= first) ++spreads;
  for (; spreads < end && spreads->source < last; ++spreads) {
    int column = spreads->source;
    for (unsigned bits = spreads->mask; bits != 0; bits &= bits - 1, ++column) {
      if (column < first || column >= last) continue;
      const double* source = parent + (spreads->target + __builtin_ctz(bits)) * parent_stride;
      double* target = U + column * child_stride;
      for (int k = 0; k < 8; k += kWidth) {
        store(target + k, Vec{});
        store(target + child_stride - 8 + k, Vec{});
      }
      for (const Spread* s = begin; s < end; ++s)
        take_spread(target + lead + s->source, source + s->target, s->mask, s->packed);
    }
  }
}

void mirror(double* U, std::int64_t child_stride, int lead, int from, int first, int last) {
  constexpr int kBlock = 8;
  for (int begin = 0; begin < from; begin += kBlock) {
    const int end = min(from, begin + kBlock);
    for (int column = first; column < last; ++column) {
      double* target = U + column * child_stride + lead;
      const double* source = U + lead + column;
      for (int row = begin; row < end; ++row) target[row] = source[row * child_stride];
    }
  }
}

#include "chain_kernels_body.hpp"

}  // namespace

extern const Kernels kernels;
const Kernels kernels{.name = CAIRN_KERNEL_NAME,
                      .lanes = kWidth,
                      .chains = {chain_kernels<3>(), chain_kernels<6>()},
                      .assemble = &assemble,
                      .factor_panel = &factor_panel,
                      .factor_rows = &factor_rows,
                      .update = &update,
                      .extend_add = &extend_add,
                      .forward = &forward,
                      .backward = &backward,
                      .forward_many = &forward_many,
                      .backward_many = &backward_many,
                      .invert_pivots = &invert_pivots,
                      .transform_rows = &transform_rows,
                      .inverse_rows = &inverse_rows,
                      .inverse_pivots = &inverse_pivots,
                      .gather = &gather,
                      .mirror = &mirror};

}  // namespace cairn::block::CAIRN_KERNEL_SET
