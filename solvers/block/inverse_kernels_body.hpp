// SPDX-License-Identifier: BSD-3-Clause
//
// The kernels that there are in double precision only, for eight right-hand sides and for selected
// inversion: a part of kernels_body.hpp, to which its rules apply.

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
        solve_from_right<N>(Vec{}, vectors, V + row, ldv, panel, stride, row, begin, reciprocal);
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
      tile<Vec>(vectors, min(kTileColumns, columns - column), m - columns, U + (row - shift), ldu,
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
