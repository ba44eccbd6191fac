// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

#include "cairn/pack/pack.hpp"

/// What linearising does with the errors and Jacobians of as many factors as S has lanes; S is
/// double or a pack. Every sum has one order, whatever S is.
namespace cairn::lanes {

/// To ask whether a function takes an M: Eigen says of any matrix that it converts to any other,
/// and fails when it does.
template <class M>
struct Only {
  operator const M&() const;  // NOLINT(google-explicit-constructor)
};

/// N numbers from each of these places, one place for each lane.
template <class S, int N>
Eigen::Matrix<S, N, 1> load_lanes(const double* const* places) {
  Eigen::Matrix<S, N, 1> x;
  for (int k = 0; k < N; ++k) {
    if constexpr (kWidth<S> == 1)
      x[k] = places[0][k];
    else
      x[k] = S(places, k);
  }
  return x;
}

/// N numbers of each of these entries of an array with N for each.
template <class S, int N, class Index>
Eigen::Matrix<S, N, 1> load_entries(const double* all, const Index* entries) {
  const double* places[kWidth<S>];
  for (int l = 0; l < kWidth<S>; ++l) places[l] = all + static_cast<std::size_t>(entries[l]) * N;
  return load_lanes<S, N>(places);
}

/// One lane of `to` becomes that of `from`.
template <class M>
void merge_lane(int lane, const M& from, M& to) {
  for (Eigen::Index k = 0; k < to.size(); ++k)
    to.data()[k] = M::Scalar::one_lane(lane, from.data()[k], to.data()[k]);
}

/// M becomes U M with U upper triangular, packed row by row.
template <class S, class M>
[[gnu::always_inline]] inline void whiten(const S* u, M& m) {
  constexpr int kRows = M::RowsAtCompileTime;
  for (int row = 0; row < kRows; ++row) {
    for (int c = 0; c < M::ColsAtCompileTime; ++c) {
      S sum = m(row, c) * u[0];
      for (int k = row + 1; k < kRows; ++k) sum += u[k - row] * m(k, c);
      m(row, c) = sum;
    }
    u += kRows - row;
  }
}

template <class S, int R>
S squared_norm(const Eigen::Matrix<S, R, 1>& r) {
  S sum = r[0] * r[0];
  for (int k = 1; k < R; ++k) sum += r[k] * r[k];
  return sum;
}

/// out = w AᵀB, column-major, or if `transposed` its transpose. With kSame, B is A, and half of
/// the symmetric product is computed.
template <bool kSame, class S, int R, int Ta, int Tb>
void multiply(const Eigen::Matrix<S, R, Ta>& A, const Eigen::Matrix<S, R, Tb>& B, const S& weight,
              bool transposed, S* out) {
  for (int row = 0; row < Ta; ++row) {
    S a[R];
    for (int k = 0; k < R; ++k) a[k] = weight * A(k, row);
    for (int c = kSame ? row : 0; c < Tb; ++c) {
      S sum = a[0] * B(0, c);
      for (int k = 1; k < R; ++k) sum += a[k] * B(k, c);
      out[transposed ? row * Tb + c : c * Ta + row] = sum;
      if (kSame) out[transposed ? c * Ta + row : row * Tb + c] = sum;
    }
  }
}

/// out = −w Aᵀr
template <class S, int R, int T>
void multiply_gradient(const Eigen::Matrix<S, R, T>& A, const Eigen::Matrix<S, R, 1>& r,
                       const S& weight, S* out) {
  for (int row = 0; row < T; ++row) {
    S sum = weight * A(0, row) * r[0];
    for (int k = 1; k < R; ++k) sum += weight * A(k, row) * r[k];
    out[row] = -sum;
  }
}

/// What `multiply` writes if `transposed`, from what it writes otherwise, and the converse.
template <int Ta, int Tb>
Eigen::Matrix<double, Ta * Tb, 1> turn_block(const double* block, bool transposed) {
  Eigen::Matrix<double, Ta * Tb, 1> turned;
  for (int row = 0; row < Ta; ++row) {
    for (int c = 0; c < Tb; ++c) {
      const int there = row * Tb + c, here = c * Ta + row;
      turned[transposed ? here : there] = block[transposed ? there : here];
    }
  }
  return turned;
}

/// Places of what a factor on variables with tangent spaces of these sizes contributes: its blocks
/// of pairs (a, b), a ≤ b, row by row of pairs, then its gradients, then its squared norm.
template <int... kSizes>
struct Contribution {
  static constexpr int kArity = sizeof...(kSizes);
  static constexpr int kSize[kArity] = {kSizes...};

  static constexpr int block(int a, int b) {
    int sum = 0;
    for (int c = 0; c <= a && c < kArity; ++c) {
      for (int d = c; d < (c == a ? b : kArity); ++d) sum += kSize[c] * kSize[d];
    }
    return sum;
  }
  static constexpr int gradient(int a) {
    int sum = block(kArity, kArity);
    for (int c = 0; c < a; ++c) sum += kSize[c];
    return sum;
  }
  static constexpr int pair(int a, int b) { return a * kArity - a * (a - 1) / 2 + (b - a); }
  static constexpr int kNorm = gradient(kArity), kNumbers = kNorm + 1;
};

namespace detail {
template <std::size_t A, class Visit, std::size_t... B>
void for_row(std::index_sequence<B...>, const Visit& visit) {
  (visit.template operator()<A, A + B>(), ...);
}
template <class Visit, std::size_t... A>
void for_rows(std::index_sequence<A...>, const Visit& visit) {
  (for_row<A>(std::make_index_sequence<sizeof...(A) - A>{}, visit), ...);
}
}  // namespace detail

/// visit.operator()<A, B>() for all pairs of variables A ≤ B.
template <std::size_t kArity, class Visit>
void for_pairs(const Visit& visit) {
  detail::for_rows(std::make_index_sequence<kArity>{}, visit);
}

#if CAIRN_PACKS
using Widest = Pack<8>;

namespace detail {
template <class S, class Loop>
[[gnu::target("avx2"), gnu::flatten]] void run_for_avx2(const Loop& loop) {
  loop.template operator()<S>();
}
template <class Loop>
[[gnu::target("avx512f"), gnu::flatten]] void run_for_avx512(const Loop& loop) {
  loop.template operator()<Widest>();
}
}  // namespace detail

/// loop.operator()<S>() with the widest S that this machine has and, unless kPacked, with S =
/// double. It is compiled for each kind of machine, with all that it calls; the results are the
/// same to the last bit.
template <bool kPacked, class Loop>
void for_machine(const Loop& loop) {
  if constexpr (kPacked) {
    if (width() == 8) return detail::run_for_avx512(loop);
  }
  if (width() >= 4) return detail::run_for_avx2<std::conditional_t<kPacked, Pack<4>, double>>(loop);
  loop.template operator()<double>();
}
#else
using Widest = double;
template <bool, class Loop>
void for_machine(const Loop& loop) {
  loop.template operator()<double>();
}
#endif

}  // namespace cairn::lanes
