// SPDX-License-Identifier: BSD-3-Clause
//
// The kernels for chains: a part of kernels_body.hpp, to which its rules apply. One lane of a
// vector is one chain.

/// Places of a node's numbers in its panel, each kWidth doubles.
template <int D>
struct NodePanel {
  static constexpr int kPivots = D * (D - 1) / 2, kV = kPivots + D, kW = kV + D * D,
                       kNumbers = kW + D * D;
  static constexpr int L(int r, int c) { return r * (r - 1) / 2 + c; }
};

typedef long long LooseMask
    __attribute__((vector_size(kWidth * sizeof(double)), aligned(8), may_alias));

alignas(64) constexpr double kZeros[36] = {};
template <int D>
struct Identity {
  double values[D * D];
  constexpr Identity() : values{} {
    for (int k = 0; k < D; ++k) values[k * D + k] = 1.0;
  }
};
template <int D>
constexpr Identity<D> kUnit{};

/// Where the blocks of all lanes are.
template <int D>
inline __attribute__((always_inline)) void find_blocks(const std::int64_t* places,
                                                       const double* values, const double** found) {
  for (int l = 0; l < kWidth; ++l) {
    found[l] = places[l] >= 0                       ? values + places[l]
               : places[l] == ChainGroup::kIdentity ? kUnit<D>.values
                                                    : kZeros;
  }
}

/// The k-th and the next number of each lane.
inline __attribute__((always_inline)) void take_two(const double* const* from, int k, Vec& one,
                                                    Vec& next) {
#if defined(__AVX512F__) || (defined(__AVX2__) && CAIRN_KERNEL_WIDTH == 4)
  const auto join = [&](int a, int b) {
    return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(from[a] + k)),
                                _mm_loadu_pd(from[b] + k), 1);
  };
#if defined(__AVX512F__)
  const auto both = [&](int a) {
    return _mm512_maskz_insertf64x4(0xff, _mm512_castpd256_pd512(join(a, a + 2)),
                                    join(a + 4, a + 6), 1);
  };
  const __m512d even = both(0), odd = both(1);
  one = _mm512_maskz_unpacklo_pd(0xff, even, odd);
  next = _mm512_maskz_unpackhi_pd(0xff, even, odd);
#else
  const __m256d even = join(0, 2), odd = join(1, 3);
  one = _mm256_unpacklo_pd(even, odd);
  next = _mm256_unpackhi_pd(even, odd);
#endif
#else
  for (int l = 0; l < kWidth; ++l) {
    one[l] = from[l][k];
    next[l] = from[l][k + 1];
  }
#endif
}
template <int N>
inline __attribute__((always_inline)) void take(const double* const* from, Vec (&out)[N]) {
  CAIRN_UNROLL
  for (int k = 0; k + 1 < N; k += 2) take_two(from, k, out[k], out[k + 1]);
  Vec again;
  if constexpr (N % 2 == 1) take_two(from, N - 2, again, out[N - 1]);
}
/// out[lane * stride + k] = numbers[k][lane]
template <int N>
inline __attribute__((always_inline)) void put_lanes(const Vec (&numbers)[N], double* out,
                                                     int stride) {
  alignas(64) double all[N * kWidth];
  for (int k = 0; k < N; ++k) store(all + k * kWidth, numbers[k]);
  for (int l = 0; l < kWidth; ++l) {
    for (int k = 0; k < N; ++k) out[l * stride + k] = all[k * kWidth + l];
  }
}

/// H_k-1,k, row by row.
template <int D>
inline __attribute__((always_inline)) void take_coupling(const ChainGroup& group, int k,
                                                         const double* values, Vec (&out)[D * D]) {
  const double* from[kWidth];
  find_blocks<D>(group.coupling + k * kWidth, values, from);
  take(from, out);
  const Mask turned = *reinterpret_cast<const LooseMask*>(group.turned + k * kWidth);
  CAIRN_UNROLL
  for (int r = 0; r < D; ++r) {
    CAIRN_UNROLL
    for (int c = r + 1; c < D; ++c) {
      const Vec a = out[r * D + c], b = out[c * D + r];
      out[r * D + c] = turned ? b : a;
      out[c * D + r] = turned ? a : b;
    }
  }
}

/// X ← L⁻¹ X, row by row.
template <int D, int N>
inline __attribute__((always_inline)) void solve_rows(const Vec* L, const Vec* pivots, Vec* X) {
  CAIRN_UNROLL
  for (int r = 0; r < D; ++r) {
    CAIRN_UNROLL
    for (int c = 0; c < N; ++c) {
      Vec sum = X[r * N + c];
      CAIRN_UNROLL
      for (int j = 0; j < r; ++j) sum -= L[NodePanel<D>::L(r, j)] * X[j * N + c];
      X[r * N + c] = sum * pivots[r];
    }
  }
}

/// sum -= AᵀB, both row by row; with kLower its lower triangle alone.
template <int D, bool kLower>
inline __attribute__((always_inline)) void subtract_product(const Vec* A, const Vec* B, Vec* sum) {
  CAIRN_UNROLL
  for (int r = 0; r < D; ++r) {
    CAIRN_UNROLL
    for (int c = 0; c < (kLower ? r + 1 : D); ++c) {
      CAIRN_UNROLL
      for (int j = 0; j < D; ++j) sum[r * D + c] -= A[j * D + r] * B[j * D + c];
    }
  }
}

/// Column-major, from one that is row by row; with kLower from its lower triangle.
template <int D, bool kLower>
inline __attribute__((always_inline)) void put_block(const Vec* rows, double* out, int stride) {
  Vec block[D * D];
  for (int r = 0; r < D; ++r) {
    for (int c = 0; c < D; ++c)
      block[c * D + r] = kLower && c > r ? rows[c * D + r] : rows[r * D + c];
  }
  put_lanes(block, out, stride);
}

template <int D>
unsigned eliminate_chains(const ChainGroup& group, const double* values, double* panel,
                          double* ends) {
  using P = NodePanel<D>;
  Vec C[D * D], next[D * D], pivot[D * D] = {}, first[D * D] = {};
  Mask sound = Mask{} - 1;
  take_coupling<D>(group, 0, values, next);
  for (int r = 0; r < D; ++r) {
    for (int c = 0; c < D; ++c) C[r * D + c] = next[c * D + r];
  }
  for (int k = 0; k < group.length; ++k, panel += P::kNumbers * kWidth) {
    const double* from[kWidth];
    find_blocks<D>(group.diagonal + k * kWidth, values, from);
    Vec H[D * D];
    take(from, H);
    Vec L[P::kPivots], pivots[D];
    CAIRN_UNROLL
    for (int c = 0; c < D; ++c) {
      CAIRN_UNROLL
      for (int r = c; r < D; ++r) {
        Vec sum = H[c * D + r] + pivot[r * D + c];
        CAIRN_UNROLL
        for (int j = 0; j < c; ++j) sum -= (r == c ? L[P::L(c, j)] : L[P::L(r, j)]) * L[P::L(c, j)];
        if (r == c) {
          sound &= (sum > 0.0) & (sum < 1.7e308);
          pivots[c] = 1.0 / roots(sum);
        } else {
          L[P::L(r, c)] = sum * pivots[c];
        }
      }
    }
    take_coupling<D>(group, k + 1, values, next);
    solve_rows<D, D>(L, pivots, next);
    solve_rows<D, D>(L, pivots, C);
    for (int i = 0; i < P::kPivots; ++i) store(panel + i * kWidth, L[i]);
    for (int i = 0; i < D; ++i) store(panel + (P::kPivots + i) * kWidth, pivots[i]);
    for (int i = 0; i < D * D; ++i) {
      store(panel + (P::kV + i) * kWidth, next[i]);
      store(panel + (P::kW + i) * kWidth, C[i]);
    }
    subtract_product<D, true>(C, C, first);
    Vec joined[D * D] = {};
    subtract_product<D, false>(next, C, joined);
    for (int i = 0; i < D * D; ++i) {
      C[i] = joined[i];
      pivot[i] = Vec{};
    }
    subtract_product<D, true>(next, next, pivot);
  }
  constexpr int kEnds = 3 * D * D;
  put_block<D, true>(first, ends, kEnds);
  put_block<D, true>(pivot, ends + D * D, kEnds);
  put_block<D, false>(C, ends + 2 * D * D, kEnds);
  unsigned failed = 0;
  for (int l = 0; l < kWidth; ++l) failed |= sound[l] != 0 ? 0u : 1u << l;
  return failed;
}

/// sum -= Aᵀ x, A row by row.
template <int D>
inline __attribute__((always_inline)) void subtract_transposed(const double* A, const Vec* x,
                                                               Vec* sum) {
  CAIRN_UNROLL
  for (int j = 0; j < D; ++j) {
    CAIRN_UNROLL
    for (int c = 0; c < D; ++c) sum[c] -= load(A + (j * D + c) * kWidth) * x[j];
  }
}

template <int D>
void forward_chains(const ChainGroup& group, const double* panel, const double* g, double* y,
                    double* ends) {
  using P = NodePanel<D>;
  Vec next[D] = {}, first[D] = {};
  for (int k = 0; k < group.length; ++k, panel += P::kNumbers * kWidth, y += D * kWidth) {
    const double* from[kWidth];
    find_blocks<D>(group.row + k * kWidth, g, from);
    Vec x[D];
    take(from, x);
    CAIRN_UNROLL
    for (int r = 0; r < D; ++r) {
      x[r] += next[r];
      CAIRN_UNROLL
      for (int j = 0; j < r; ++j) x[r] -= load(panel + P::L(r, j) * kWidth) * x[j];
      x[r] *= load(panel + (P::kPivots + r) * kWidth);
      store(y + r * kWidth, x[r]);
    }
    for (int r = 0; r < D; ++r) next[r] = Vec{};
    subtract_transposed<D>(panel + P::kV * kWidth, x, next);
    subtract_transposed<D>(panel + P::kW * kWidth, x, first);
  }
  put_lanes(first, ends, 2 * D);
  put_lanes(next, ends + D, 2 * D);
}

template <int D>
void backward_chains(const ChainGroup& group, const double* panel, const double* y,
                     const double* ends, double* out) {
  using P = NodePanel<D>;
  const double* from[kWidth];
  Vec first[D], next[D];
  for (int l = 0; l < kWidth; ++l) from[l] = ends + l * 2 * D;
  take(from, first);
  for (int l = 0; l < kWidth; ++l) from[l] += D;
  take(from, next);
  panel += group.length * P::kNumbers * kWidth;
  y += group.length * D * kWidth;
  for (int k = group.length - 1; k >= 0; --k) {
    panel -= P::kNumbers * kWidth;
    y -= D * kWidth;
    Vec x[D];
    CAIRN_UNROLL
    for (int r = 0; r < D; ++r) {
      x[r] = load(y + r * kWidth);
      CAIRN_UNROLL
      for (int c = 0; c < D; ++c) {
        x[r] -= load(panel + (P::kV + r * D + c) * kWidth) * next[c];
        x[r] -= load(panel + (P::kW + r * D + c) * kWidth) * first[c];
      }
    }
    CAIRN_UNROLL
    for (int r = D - 1; r >= 0; --r) {
      CAIRN_UNROLL
      for (int j = r + 1; j < D; ++j) x[r] -= load(panel + P::L(j, r) * kWidth) * x[j];
      x[r] *= load(panel + (P::kPivots + r) * kWidth);
    }
    alignas(64) double all[D * kWidth];
    for (int r = 0; r < D; ++r) store(all + r * kWidth, x[r]);
    for (int l = 0; l < kWidth; ++l) {
      const std::int64_t row = group.row[k * kWidth + l];
      if (row < 0) continue;
      for (int r = 0; r < D; ++r) out[row + r] = all[r * kWidth + l];
    }
    for (int r = 0; r < D; ++r) next[r] = x[r];
  }
}

template <int D>
constexpr ChainKernels chain_kernels() {
  return {&eliminate_chains<D>, &forward_chains<D>, &backward_chains<D>};
}
