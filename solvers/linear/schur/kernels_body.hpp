// SPDX-License-Identifier: BSD-3-Clause
//
// The kernels of kernels.hpp, compiled once for each instruction set: the including file sets
// CAIRN_KERNEL_SET (a name) and CAIRN_KERNEL_WIDTH (doubles in a vector register), and is compiled
// with that set's flags.
//
// Nothing but raw pointers and builtins may stand here: an inline function of the standard library,
// compiled here for a newer machine, could be the copy that the linker keeps for everyone.

#include "kernels.hpp"

namespace cairn::schur::CAIRN_KERNEL_SET {
namespace {

constexpr int kWidth = CAIRN_KERNEL_WIDTH;
typedef double Vec __attribute__((vector_size(kWidth * sizeof(double))));
typedef double LooseVec __attribute__((vector_size(kWidth * sizeof(double)), aligned(8)));
static_assert(kWidth <= kOverread);

inline __attribute__((always_inline)) Vec load(const double* p) {
  return *reinterpret_cast<const LooseVec*>(p);
}
/// value - 0 is the value; 0 + value would be an addition, since it is not for -0.
inline __attribute__((always_inline)) Vec broadcast(double value) { return value - Vec{}; }

/// Registers of the instruction set that sums may take.
constexpr int kSums = kWidth == 8 ? 24 : 12;
constexpr int min(int a, int b) { return a < b ? a : b; }

// --- product

/// `length` entries of a vector laid out in registers. One entry beyond whole registers is kept by
/// itself: a register for it alone would double the work on blocks of nine.
template <int kLength>
struct Layout {
  static constexpr bool kLone = (kLength > kWidth) && (kLength % kWidth == 1);
  static constexpr int kVectors = kLone ? kLength / kWidth : (kLength + kWidth - 1) / kWidth;
};

/// Columns [begin, begin + N) of C -= Σ Y_left Y_rightᵀ, C having M rows and `columns` columns. The
/// sums stay in registers over all pairs. The lone last row of C is kept as a row.
template <int M, int N, int K>
inline __attribute__((always_inline)) void product_columns(double* C, const Pair* first,
                                                           const Pair* last, const double* Y,
                                                           int columns, int begin) {
  constexpr int V = Layout<M>::kVectors;
  constexpr bool kLoneRow = Layout<M>::kLone;
  constexpr int R = Layout<N>::kVectors;
  constexpr bool kCorner = kLoneRow && Layout<N>::kLone;
  Vec sums[N][V];
  Vec row[R];
  double corner = 0.0;
  for (int n = 0; n < N; ++n) {
    for (int v = 0; v < V; ++v) sums[n][v] = Vec{};
  }
  for (int v = 0; v < R; ++v) row[v] = Vec{};
  for (; first != last; ++first) {
    const double* left = Y + first->left;
    const double* right = Y + first->right + begin;
#pragma GCC unroll 9
    for (int k = 0; k < K; ++k) {
      const double* a = left + k * M;
      const double* b = right + k * columns;
      Vec lefts[V];
      for (int v = 0; v < V; ++v) lefts[v] = load(a + v * kWidth);
      for (int n = 0; n < N; ++n) {
        const Vec bn = broadcast(b[n]);
        for (int v = 0; v < V; ++v) sums[n][v] += lefts[v] * bn;
      }
      if constexpr (kLoneRow) {
        const Vec lone = broadcast(a[M - 1]);
        for (int v = 0; v < R; ++v) row[v] += lone * load(b + v * kWidth);
        if constexpr (kCorner) corner += a[M - 1] * b[N - 1];
      }
    }
  }
  C += begin * M;
  for (int n = 0; n < N; ++n) {
    double column[V * kWidth];
    for (int v = 0; v < V; ++v) {
      for (int k = 0; k < kWidth; ++k) column[v * kWidth + k] = sums[n][v][k];
    }
    for (int m = 0; m < (kLoneRow ? M - 1 : M); ++m) C[n * M + m] -= column[m];
  }
  if constexpr (kLoneRow) {
    for (int n = 0; n < (kCorner ? N - 1 : N); ++n) C[n * M + M - 1] -= row[n / kWidth][n % kWidth];
    if constexpr (kCorner) C[(N - 1) * M + M - 1] -= corner;
  }
}

/// Columns that fit into registers at a time.
template <int M, int N>
constexpr int columns_at_a_time() {
  constexpr int most = kSums / Layout<M>::kVectors;
  constexpr int passes = (N + most - 1) / most;
  return (N + passes - 1) / passes;
}

template <int M, int N, int K>
void product(double* C, const Pair* first, const Pair* last, const double* Y, int, int, int) {
  constexpr int kTile = columns_at_a_time<M, N>();
  int begin = 0;
  for (; begin + kTile <= N; begin += kTile)
    product_columns<M, kTile, K>(C, first, last, Y, N, begin);
  if constexpr (N % kTile != 0) product_columns<M, N % kTile, K>(C, first, last, Y, N, begin);
}

/// A tile of up to kWidth rows and N columns of C, for sizes not known when compiling.
template <int N>
void product_tile(double* C, const Pair* first, const Pair* last, const double* Y, int rows,
                  int columns, int inner, int row, int column) {
  Vec sums[N];
  for (int n = 0; n < N; ++n) sums[n] = Vec{};
  for (; first != last; ++first) {
    const double* left = Y + first->left + row;
    const double* right = Y + first->right + column;
    for (int k = 0; k < inner; ++k) {
      const Vec a = load(left + k * rows);
      for (int n = 0; n < N; ++n) sums[n] += a * broadcast(right[k * columns + n]);
    }
  }
  const int height = min(kWidth, rows - row);
  for (int n = 0; n < N; ++n) {
    for (int m = 0; m < height; ++m) C[(column + n) * rows + row + m] -= sums[n][m];
  }
}

void product_general(double* C, const Pair* first, const Pair* last, const double* Y, int rows,
                     int columns, int inner) {
  for (int row = 0; row < rows; row += kWidth) {
    int column = 0;
    for (; column + 4 <= columns; column += 4)
      product_tile<4>(C, first, last, Y, rows, columns, inner, row, column);
    for (; column < columns; ++column)
      product_tile<1>(C, first, last, Y, rows, columns, inner, row, column);
  }
}

template <int M, int N>
Product product_of(int inner) {
  switch (inner) {
    case 2:
      return &product<M, N, 2>;
    case 3:
      return &product<M, N, 3>;
    case 6:
      return &product<M, N, 6>;
    default:
      return &product_general;
  }
}

template <int M>
Product product_of(int columns, int inner) {
  switch (columns) {
    case 2:
      return product_of<M, 2>(inner);
    case 3:
      return product_of<M, 3>(inner);
    case 6:
      return product_of<M, 6>(inner);
    case 9:
      return product_of<M, 9>(inner);
    default:
      return &product_general;
  }
}

Product product_of(int rows, int columns, int inner) {
  switch (rows) {
    case 2:
      return product_of<2>(columns, inner);
    case 3:
      return product_of<3>(columns, inner);
    case 6:
      return product_of<6>(columns, inner);
    case 9:
      return product_of<9>(columns, inner);
    default:
      return &product_general;
  }
}

// --- eliminate

/// Cholesky factorisation of a block in place, only its lower triangle. Each pivot is divided by at
/// once and all of them get their roots at the end: a root in each step would double the time that
/// the next step waits.
inline __attribute__((always_inline)) bool factor_in_place(double* L, int n) {
  bool positive = true;
#pragma GCC unroll 9
  for (int j = 0; j < n; ++j) {
    const double reciprocal = 1.0 / L[j * n + j];
    // What overflowed, or would when inverted, has no factor either.
    positive = positive && reciprocal > 0.0 && reciprocal < 1.7e308;
#pragma GCC unroll 9
    for (int k = j + 1; k < n; ++k) {
      const double factor = L[j * n + k] * reciprocal;
#pragma GCC unroll 9
      for (int i = k; i < n; ++i) L[k * n + i] -= L[j * n + i] * factor;
    }
    L[j * n + j] = reciprocal;
  }
#pragma GCC unroll 9
  for (int j = 0; j < n; ++j) {
    const double root = __builtin_sqrt(L[j * n + j]);
    L[j * n + j] = root;
#pragma GCC unroll 9
    for (int i = j + 1; i < n; ++i) L[j * n + i] *= root;
  }
  return positive;
}

/// L of a block A whose size is S, in registers where that is small; or `size` where S is 0.
template <int S>
inline __attribute__((always_inline)) bool factor(const double* A, double* L, int size) {
  if constexpr (S > 0 && S <= 3) {
    double a[S * S];
    for (int k = 0; k < S * S; ++k) a[k] = A[k];
    const bool positive = factor_in_place(a, S);
    for (int k = 0; k < S * S; ++k) L[k] = a[k];
    return positive;
  } else {
    const int n = S > 0 ? S : size;
    for (int k = 0; k < n * n; ++k) L[k] = A[k];
    return factor_in_place(L, n);
  }
}

/// Rows [R, D) of Y = W L⁻ᵀ, N at a time, then half as many: no lane is idle, and nothing beyond Y
/// is written, which may be another task's. W is D × S, or its transpose.
template <int S, int D, int N, int R = 0>
inline __attribute__((always_inline)) void divide_rows(const double* W, bool transposed,
                                                       const double* L, double* Y) {
  if constexpr (R < D) {
    if constexpr (R + N > D) {
      divide_rows<S, D, N / 2, R>(W, transposed, L, Y);
    } else {
      typedef double Part __attribute__((vector_size(N * sizeof(double))));
      typedef double LoosePart __attribute__((vector_size(N * sizeof(double)), aligned(8)));
      Part y[S] = {};
      if (transposed) {
        for (int j = 0; j < S; ++j) {
          for (int r = 0; r < N; ++r) y[j][r] = W[(R + r) * S + j];
        }
      } else {
        for (int j = 0; j < S; ++j) y[j] = *reinterpret_cast<const LoosePart*>(W + j * D + R);
      }
      for (int j = 0; j < S; ++j) {
        for (int k = 0; k < j; ++k) y[j] -= y[k] * (L[k * S + j] - Part{});
        y[j] *= L[j * S + j] - Part{};
        *reinterpret_cast<LoosePart*>(Y + j * D + R) = y[j];
      }
      divide_rows<S, D, N, R + N>(W, transposed, L, Y);
    }
  }
}

/// The same for any size and number of rows.
void divide(const double* W, bool transposed, const double* L, double* Y, int rows, int size) {
  for (int j = 0; j < size; ++j) {
    double* y = Y + j * rows;
    for (int r = 0; r < rows; ++r) y[r] = transposed ? W[r * size + j] : W[j * rows + r];
    for (int k = 0; k < j; ++k) {
      for (int r = 0; r < rows; ++r) y[r] -= Y[k * rows + r] * L[k * size + j];
    }
    for (int r = 0; r < rows; ++r) y[r] *= L[j * size + j];
  }
}

template <int S>
bool eliminate(const double* H, std::int64_t diagonal, const Neighbour* first,
               const Neighbour* last, double* L, double* Y, int size) {
  if (!factor<S>(H + diagonal, L, size)) return false;
  for (; first != last; ++first) {
    const double* W = H + first->source;
    double* target = Y + first->target;
    if constexpr (S > 0) {
      // Neighbours lie in as many places of H: too many for the machine to see what comes next.
      const double* next = H + first[kLookahead].source;
      for (int k = 0; k < S * first[kLookahead].rows; k += 8) __builtin_prefetch(next + k);
      if (first->rows == 3) {
        divide_rows<S, 3, kWidth>(W, first->transposed, L, target);
        continue;
      }
      if (first->rows == 6) {
        divide_rows<S, 6, kWidth>(W, first->transposed, L, target);
        continue;
      }
      if (first->rows == 9) {
        divide_rows<S, 9, kWidth>(W, first->transposed, L, target);
        continue;
      }
    }
    divide(W, first->transposed, L, target, first->rows, size);
  }
  return true;
}

Eliminate eliminate_of(int size) {
  switch (size) {
    case 2:
      return &eliminate<2>;
    case 3:
      return &eliminate<3>;
    case 6:
      return &eliminate<6>;
    case 9:
      return &eliminate<9>;
    default:
      return &eliminate<0>;
  }
}

// --- forward and backward

/// M entries of a vector in registers, the lone last one by itself.
template <int M>
struct Entries {
  static constexpr int V = Layout<M>::kVectors;
  static constexpr bool kLone = Layout<M>::kLone;
  Vec vectors[V] = {};
  double lone = 0.0;

  /// += a x, or += a ⊙ x, with x at `x`.
  inline __attribute__((always_inline)) void add(double a, const double* x) {
    for (int v = 0; v < V; ++v) vectors[v] += broadcast(a) * load(x + v * kWidth);
    if constexpr (kLone) lone += a * x[M - 1];
  }
  inline __attribute__((always_inline)) void add(const double* a, const double* x) {
    for (int v = 0; v < V; ++v) vectors[v] += load(a + v * kWidth) * load(x + v * kWidth);
    if constexpr (kLone) lone += a[M - 1] * x[M - 1];
  }
  double operator[](int m) const {
    return kLone && m == M - 1 ? lone : vectors[m / kWidth][m % kWidth];
  }
};

template <int M, int K>
void forward(const Incidence* first, const Incidence* last, const double* Y, const double* z,
             double* y, int, int) {
  Entries<M> sums;
  for (; first != last; ++first) {
    for (int k = 0; k < K; ++k) sums.add(z[first->part + k], Y + first->place + k * M);
  }
  for (int m = 0; m < M; ++m) y[m] -= sums[m];
}

void forward_general(const Incidence* first, const Incidence* last, const double* Y,
                     const double* z, double* y, int rows, int inner) {
  for (; first != last; ++first) {
    for (int k = 0; k < inner; ++k) {
      for (int m = 0; m < rows; ++m) y[m] -= Y[first->place + k * rows + m] * z[first->part + k];
    }
  }
}

template <int M, int K>
void backward(const Neighbour* first, const Neighbour* last, const double* Y,
              const std::int64_t* begin, const double* y, double* z, int, int) {
  Entries<M> sums[K];
  for (; first != last; ++first) {
    for (int k = 0; k < K; ++k) sums[k].add(Y + first->target + k * M, y + begin[first->block]);
  }
  for (int k = 0; k < K; ++k) {
    double total = 0.0;
    for (int m = 0; m < M; ++m) total += sums[k][m];
    z[k] -= total;
  }
}

void backward_general(const Neighbour* first, const Neighbour* last, const double* Y,
                      const std::int64_t* begin, const double* y, double* z, int rows, int inner) {
  for (; first != last; ++first) {
    for (int k = 0; k < inner; ++k) {
      double total = 0.0;
      for (int m = 0; m < rows; ++m)
        total += Y[first->target + k * rows + m] * y[begin[first->block] + m];
      z[k] -= total;
    }
  }
}

template <int M>
Forward forward_of(int inner) {
  return inner == 2   ? &forward<M, 2>
         : inner == 3 ? &forward<M, 3>
         : inner == 6 ? &forward<M, 6>
                      : &forward_general;
}
template <int M>
Backward backward_of(int inner) {
  return inner == 2   ? &backward<M, 2>
         : inner == 3 ? &backward<M, 3>
         : inner == 6 ? &backward<M, 6>
                      : &backward_general;
}

Forward forward_of(int rows, int inner) {
  switch (rows) {
    case 2:
      return forward_of<2>(inner);
    case 3:
      return forward_of<3>(inner);
    case 6:
      return forward_of<6>(inner);
    case 9:
      return forward_of<9>(inner);
    default:
      return &forward_general;
  }
}

Backward backward_of(int rows, int inner) {
  switch (rows) {
    case 2:
      return backward_of<2>(inner);
    case 3:
      return backward_of<3>(inner);
    case 6:
      return backward_of<6>(inner);
    case 9:
      return backward_of<9>(inner);
    default:
      return &backward_general;
  }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{CAIRN_KERNEL_NAME, &product_of, &eliminate_of, &forward_of, &backward_of};

}  // namespace cairn::schur::CAIRN_KERNEL_SET
