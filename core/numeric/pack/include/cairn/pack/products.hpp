// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
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
  if constexpr (kWidth<S> == 1) {
    for (int k = 0; k < N; ++k) x[k] = places[0][k];
  } else if constexpr (N == 1) {
    x[0] = S(places, 0);
  } else {
    for (int k = 0; k + 1 < N; k += 2) S::load_two(places, k, x[k], x[k + 1]);
    S again;
    if (N % 2 == 1) S::load_two(places, N - 2, again, x[N - 1]);
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

/// The same where most often all lanes have one entry.
template <class S, int N, class Index>
Eigen::Matrix<S, N, 1> load_entries_often_equal(const double* all, const Index* entries) {
  bool equal = kWidth<S> > 1;
  for (int l = 1; l < kWidth<S>; ++l) equal = equal && entries[l] == entries[0];
  if (!equal) return load_entries<S, N>(all, entries);
  const double* one = all + static_cast<std::size_t>(entries[0]) * N;
  Eigen::Matrix<S, N, 1> x;
  for (int k = 0; k < N; ++k) x[k] = one[k];
  return x;
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

/// out(k) = the k-th number of w AᵀB, column-major, or with kTransposed of its transpose. With
/// kSame, B is A, and half of the symmetric product is computed.
template <bool kSame, bool kTransposed, class S, int R, int Ta, int Tb, class Out>
void multiply(const Eigen::Matrix<S, R, Ta>& A, const Eigen::Matrix<S, R, Tb>& B, const S& weight,
              const Out& out) {
  for (int row = 0; row < Ta; ++row) {
    S a[R];
    for (int k = 0; k < R; ++k) a[k] = weight * A(k, row);
    for (int c = kSame ? row : 0; c < Tb; ++c) {
      S sum = a[0] * B(0, c);
      for (int k = 1; k < R; ++k) sum += a[k] * B(k, c);
      out(kTransposed ? row * Tb + c : c * Ta + row) = sum;
      if (kSame) out(kTransposed ? c * Ta + row : row * Tb + c) = sum;
    }
  }
}

/// out(k) = the k-th number of −w Aᵀr.
template <class S, int R, int T, class Out>
void multiply_gradient(const Eigen::Matrix<S, R, T>& A, const Eigen::Matrix<S, R, 1>& r,
                       const S& weight, const Out& out) {
  for (int row = 0; row < T; ++row) {
    S sum = weight * A(0, row) * r[0];
    for (int k = 1; k < R; ++k) sum += weight * A(k, row) * r[k];
    out(row) = -sum;
  }
}

/// How long a stretch begins where so many numbers of a part are left: see `Contribution`.
constexpr int stretch(int left) { return left >= 8 ? 8 : left >= 4 ? 4 : left >= 2 ? 2 : 1; }

/// What a factor on variables with tangent spaces of these sizes contributes: its blocks of pairs
/// (a, b), a ≤ b, row by row of pairs, then its gradients, then its squared norm.
///
/// Its numbers do not lie in that order. Each block and gradient is cut into stretches of 8, 4, 2
/// and 1 numbers; first come all of 8, then all of 4, and so on. So each stretch lies where one
/// vector was stored, and is read back without waiting for two.
template <int... kSizes>
struct Contribution {
  static constexpr int kArity = sizeof...(kSizes);
  static constexpr int kPairs = kArity * (kArity + 1) / 2;
  static constexpr int kSize[kArity] = {kSizes...};

  static constexpr int pair(int a, int b) { return a * kArity - a * (a - 1) / 2 + (b - a); }

  /// Its parts by number: kPairs blocks, kArity gradients, the norm.
  static constexpr int kParts = kPairs + kArity + 1;
  static constexpr std::array<int, kParts + 1> kFirst = [] {
    std::array<int, kParts + 1> first{};
    int part = 0;
    const auto next = [&](int size) {
      first[part + 1] = first[part] + size;
      ++part;
    };
    for (int a = 0; a < kArity; ++a) {
      for (int b = a; b < kArity; ++b) next(kSize[a] * kSize[b]);
    }
    for (int a = 0; a < kArity; ++a) next(kSize[a]);
    next(1);
    return first;
  }();
  static constexpr int kNumbers = kFirst[kParts];
  static constexpr int size(int part) { return kFirst[part + 1] - kFirst[part]; }

  /// Where the k-th number of a part lies.
  static constexpr int place(int part, int k) { return kPlaces[kFirst[part] + k]; }

 private:
  static constexpr std::array<int, kNumbers> kPlaces = [] {
    std::array<int, kNumbers> places{};
    int next = 0;
    for (const int length : {8, 4, 2, 1}) {
      for (int part = 0; part < kParts; ++part) {
        const int begin = kFirst[part], end = kFirst[part + 1];
        for (int k = begin; k < end;) {
          const int now = stretch(end - k);
          for (int i = 0; now == length && i < now; ++i) places[k + i] = next++;
          k += now;
        }
      }
    }
    return places;
  }();
};

/// Writes or adds a part of what one factor contributes, whose numbers are `values`.
template <class S, class Places, int kPart>
[[gnu::always_inline]] inline void put_part(const double* values, bool adds, double* to) {
  constexpr int kSize = Places::size(kPart), kEights = kSize / 8 * 8;
#pragma GCC unroll 8
  for (int k = 0; k < kEights; k += 8)
    put<S, 8>(values + Places::place(kPart, 0) + k, adds, to + k);
  if constexpr ((kSize & 4) != 0)
    put<S, 4>(values + Places::place(kPart, kEights), adds, to + kEights);
  constexpr int kTwo = kSize & ~3, kOne = kSize & ~1;
  if constexpr ((kSize & 2) != 0) put<S, 2>(values + Places::place(kPart, kTwo), adds, to + kTwo);
  if constexpr ((kSize & 1) != 0) put<S, 1>(values + Places::place(kPart, kOne), adds, to + kOne);
}
/// The same of a block of kRows × kColumns, transposed.
template <class S, class Places, int kPart, int kRows, int kColumns>
void put_turned(const double* values, bool adds, double* to) {
  static constexpr auto kPlaces = [] {
    std::array<int, kRows * kColumns> places{};
    for (int row = 0; row < kRows; ++row) {
      for (int c = 0; c < kColumns; ++c)
        places[row * kColumns + c] = Places::place(kPart, c * kRows + row);
    }
    return places;
  }();
  for (int k = 0; k < kRows * kColumns; ++k)
    to[k] = adds ? to[k] + values[kPlaces[k]] : values[kPlaces[k]];
}

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

/// out = step(x, δ) for `count` states of A numbers each, as many at a time as this machine can if
/// kPacked. δ, T numbers, of state s begins at delta[offsets[s]]; where that is below zero, the
/// state stays as it is. `out` may be `x`.
template <bool kPacked, int A, int T, class Step>
void move_states(std::size_t count, const double* x, const std::int64_t* offsets,
                 const double* delta, double* out, const Step& step) {
  for_machine<kPacked>([&]<class S>() {
    constexpr int kLanes = kWidth<S>, kPadded = (A + kLanes - 1) / kLanes * kLanes;
    static constexpr double kNoStep[T] = {};
    for (std::size_t first = 0; first < count; first += kLanes) {
      const double *states[kLanes], *steps[kLanes];
      for (std::size_t l = 0; l < kLanes; ++l) {
        const std::size_t s = std::min(first + l, count - 1);
        states[l] = x + s * A;
        steps[l] = offsets[s] < 0 ? kNoStep : delta + offsets[s];
      }
      S moved[kPadded];
      const auto move = [&](const double* const* from, const double* const* by) {
        const Eigen::Matrix<S, A, 1> y =
            step.template operator()<S>(load_lanes<S, A>(from), load_lanes<S, T>(by));
        for (int k = 0; k < A; ++k) moved[k] = y[k];
        for (int k = A; k < kPadded; ++k) moved[k] = 0.0;
      };
      const auto put = [&](std::size_t l, const double* y) {
        std::copy_n(offsets[first + l] < 0 ? states[l] : y, A, out + (first + l) * A);
      };
      if constexpr (kLanes == 1) {
        move(states, steps);
        put(0, moved);
      } else {
        S::diverged = false;
        move(states, steps);
        const std::size_t used = std::min<std::size_t>(kLanes, count - first);
        if (!S::diverged) [[likely]] {
          const Separate<S, kPadded> separate(moved);
          for (std::size_t l = 0; l < used; ++l) put(l, separate.lane(l));
          continue;
        }
        // Where a branch divides the lanes, each by itself, in all lanes.
        for (std::size_t l = 0; l < used; ++l) {
          const double *state[kLanes], *its_step[kLanes];
          std::fill_n(state, kLanes, states[l]);
          std::fill_n(its_step, kLanes, steps[l]);
          move(state, its_step);
          put(l, Separate<S, kPadded>(moved).lane(0));
        }
      }
    }
  });
}

}  // namespace cairn::lanes
