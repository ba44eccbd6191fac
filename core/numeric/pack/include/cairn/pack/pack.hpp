// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstddef>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

// Packs exist where the program may find out when it runs that the machine can work on them. With
// clang, elsewhere, and where everything is compiled for AVX2 anyway, there is only double.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__)
#define CAIRN_PACKS 1
#else
#define CAIRN_PACKS 0
#endif

/// The same number of several factors at a time: a pack has W lanes, each a double, and arithmetic
/// works on all of them at once. Lane by lane it is the arithmetic of doubles, to the last bit: it
/// adds where they add, and never multiplies and adds in one step.
///
/// The functions here that are neither operators nor those of <cmath> take a double or a pack, so
/// that one template is good for both. The functions of <cmath> are visible in this namespace for
/// doubles too; those of packs call the C library once for each lane, all but sqrt and abs.
namespace cairn::lanes {

/// f(x), lane by lane.
template <class F>
double map(double x, F f) {
  return f(x);
}
/// |x| <= bound, in all lanes.
inline bool all_within(double x, double bound) { return std::abs(x) <= bound; }
/// x where a < b, else y.
inline double if_less(double a, double b, double x, double y) { return a < b ? x : y; }
/// Whether x < bound: in all lanes 1, in none 0, else -1.
inline int is_below(double x, double bound) { return x < bound ? 1 : 0; }

template <class T>
inline constexpr int kWidth = 1;

#if CAIRN_PACKS

typedef double Raw4 __attribute__((vector_size(32)));
typedef double Raw8 __attribute__((vector_size(64)));
typedef long long Bits4 __attribute__((vector_size(32)));
typedef long long Bits8 __attribute__((vector_size(64)));
// Doubles anywhere in an array.
typedef double Loose2 __attribute__((vector_size(16), aligned(8), may_alias));
typedef double Loose4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef double Loose8 __attribute__((vector_size(64), aligned(8), may_alias));

// Each instruction is a function for its own machine, which takes vectors by reference: so it means
// the same to callers that are compiled for any machine. Loops over factors are `flatten`, and all
// of these functions become part of them. With AVX-512 comes fused multiplication and addition; the
// empty `asm` hides from the compiler that a summand is a product.
#define CAIRN_FOR_4 [[gnu::target("avx2")]] inline
#define CAIRN_FOR_8 [[gnu::target("avx512f")]] inline
// clang-format off
CAIRN_FOR_4 void fill(double x, Raw4& r) { r = Raw4{x, x, x, x}; }
CAIRN_FOR_8 void fill(double x, Raw8& r) { r = Raw8{x, x, x, x, x, x, x, x}; }
CAIRN_FOR_4 void add(const Raw4& a, const Raw4& b, Raw4& r) { r = a + b; }
CAIRN_FOR_8 void add(const Raw8& a, const Raw8& b, Raw8& r) { r = a + b; }
CAIRN_FOR_4 void subtract(const Raw4& a, const Raw4& b, Raw4& r) { r = a - b; }
CAIRN_FOR_8 void subtract(const Raw8& a, const Raw8& b, Raw8& r) { r = a - b; }
CAIRN_FOR_4 void multiply(const Raw4& a, const Raw4& b, Raw4& r) { r = a * b; }
CAIRN_FOR_8 void multiply(const Raw8& a, const Raw8& b, Raw8& r) {
  r = a * b;
  asm("" : "+v"(r));
}
CAIRN_FOR_4 void divide(const Raw4& a, const Raw4& b, Raw4& r) { r = a / b; }
CAIRN_FOR_8 void divide(const Raw8& a, const Raw8& b, Raw8& r) { r = a / b; }
CAIRN_FOR_4 void negate(const Raw4& a, Raw4& r) { r = -a; }
CAIRN_FOR_8 void negate(const Raw8& a, Raw8& r) { r = -a; }
CAIRN_FOR_4 void square_root(const Raw4& a, Raw4& r) { r = __builtin_ia32_sqrtpd256(a); }
CAIRN_FOR_8 void square_root(const Raw8& a, Raw8& r) { r = __builtin_ia32_sqrtpd512_mask(a, a, -1, 4); }
CAIRN_FOR_4 void absolute(const Raw4& a, Raw4& r) { r = (Raw4)((Bits4)a & std::numeric_limits<long long>::max()); }
CAIRN_FOR_8 void absolute(const Raw8& a, Raw8& r) { r = (Raw8)((Bits8)a & std::numeric_limits<long long>::max()); }
/// One bit for each lane: a < b, a = b.
CAIRN_FOR_4 unsigned less(const Raw4& a, const Raw4& b) { return __builtin_ia32_movmskpd256((Raw4)(a < b)); }
CAIRN_FOR_8 unsigned less(const Raw8& a, const Raw8& b) { return __builtin_ia32_cmppd512_mask(a, b, 1, -1, 4); }
CAIRN_FOR_4 unsigned equal(const Raw4& a, const Raw4& b) { return __builtin_ia32_movmskpd256((Raw4)(a == b)); }
CAIRN_FOR_8 unsigned equal(const Raw8& a, const Raw8& b) { return __builtin_ia32_cmppd512_mask(a, b, 0, -1, 4); }
/// x where a < b, else y.
CAIRN_FOR_4 void blend(const Raw4& a, const Raw4& b, const Raw4& x, const Raw4& y, Raw4& r) { r = a < b ? x : y; }
CAIRN_FOR_8 void blend(const Raw8& a, const Raw8& b, const Raw8& x, const Raw8& y, Raw8& r) { r = a < b ? x : y; }
/// The k-th double of each row.
CAIRN_FOR_4 void collect(const double* const* row, int k, Raw4& r) { r = Raw4{row[0][k], row[1][k], row[2][k], row[3][k]}; }
CAIRN_FOR_8 void collect(const double* const* row, int k, Raw8& r) {
  r = Raw8{row[0][k], row[1][k], row[2][k], row[3][k], row[4][k], row[5][k], row[6][k], row[7][k]};
}
// clang-format on
/// Two doubles of each of two rows, or of four, side by side.
CAIRN_FOR_4 void join(const double* a, const double* b, Raw4& r) {
  r = __builtin_ia32_vinsertf128_pd256(__builtin_ia32_pd256_pd(*(const Loose2*)a),
                                       *(const Loose2*)b, 1);
}
CAIRN_FOR_8 void join(const double* a, const double* b, const double* c, const double* d, Raw8& r) {
  Raw4 low, high;
  join(a, b, low);
  join(c, d, high);
  r = __builtin_ia32_insertf64x4_mask(__builtin_ia32_pd512_256pd(low), high, 1, r, -1);
}
/// The k-th double of each row and the one after it.
CAIRN_FOR_4 void collect_two(const double* const* row, int k, Raw4& r, Raw4& next) {
  Raw4 even, odd;
  join(row[0] + k, row[2] + k, even);
  join(row[1] + k, row[3] + k, odd);
  r = __builtin_shuffle(even, odd, Bits4{0, 4, 2, 6});
  next = __builtin_shuffle(even, odd, Bits4{1, 5, 3, 7});
}
CAIRN_FOR_8 void collect_two(const double* const* row, int k, Raw8& r, Raw8& next) {
  Raw8 even{}, odd{};
  join(row[0] + k, row[2] + k, row[4] + k, row[6] + k, even);
  join(row[1] + k, row[3] + k, row[5] + k, row[7] + k, odd);
  r = __builtin_shuffle(even, odd, Bits8{0, 8, 2, 10, 4, 12, 6, 14});
  next = __builtin_shuffle(even, odd, Bits8{1, 9, 3, 11, 5, 13, 7, 15});
}
/// N doubles, a power of two: to = from, or to += from.
template <int N>
CAIRN_FOR_4 void put_for_4(const double* from, bool adds, double* to) {
  if constexpr (N == 8) {
    put_for_4<4>(from, adds, to);
    put_for_4<4>(from + 4, adds, to + 4);
  } else if constexpr (N == 4) {
    *(Loose4*)to = adds ? *(Loose4*)to + *(const Loose4*)from : *(const Loose4*)from;
  } else if constexpr (N == 2) {
    *(Loose2*)to = adds ? *(Loose2*)to + *(const Loose2*)from : *(const Loose2*)from;
  } else {
    *to = adds ? *to + *from : *from;
  }
}
template <int N>
CAIRN_FOR_8 void put_for_8(const double* from, bool adds, double* to) {
  if constexpr (N == 8)
    *(Loose8*)to = adds ? *(Loose8*)to + *(const Loose8*)from : *(const Loose8*)from;
  else
    put_for_4<N>(from, adds, to);
}
/// c + i s times i to the power of the integer that `rounded` holds in its last bits.
#define CAIRN_TURN(RAW, BITS)                         \
  const BITS turns = (BITS)rounded;                   \
  BITS a = (BITS)c, b = (BITS)s;                      \
  const BITS swapped = (a ^ b) & -(turns & 1);        \
  c = (RAW)(a ^ swapped ^ (((turns + 1) & 2) << 62)); \
  s = (RAW)(b ^ swapped ^ ((turns & 2) << 62));
// clang-format off
CAIRN_FOR_4 void turn(const Raw4& rounded, Raw4& c, Raw4& s) { CAIRN_TURN(Raw4, Bits4) }
CAIRN_FOR_8 void turn(const Raw8& rounded, Raw8& c, Raw8& s) { CAIRN_TURN(Raw8, Bits8) }
// clang-format on
#undef CAIRN_TURN

/// out[lane * n + k] = in[k][lane], n a multiple of the number of lanes.
[[gnu::target("avx2"), gnu::noinline]] inline void transpose(const Raw4* in, int n, double* out) {
  for (int k = 0; k < n; k += 4, in += 4) {
    const Raw4 a = __builtin_shuffle(in[0], in[1], Bits4{0, 4, 2, 6}),
               b = __builtin_shuffle(in[0], in[1], Bits4{1, 5, 3, 7}),
               c = __builtin_shuffle(in[2], in[3], Bits4{0, 4, 2, 6}),
               d = __builtin_shuffle(in[2], in[3], Bits4{1, 5, 3, 7});
    constexpr Bits4 kLow{0, 1, 4, 5}, kHigh{2, 3, 6, 7};
    const Raw4 lane[4] = {__builtin_shuffle(a, c, kLow), __builtin_shuffle(b, d, kLow),
                          __builtin_shuffle(a, c, kHigh), __builtin_shuffle(b, d, kHigh)};
    for (int l = 0; l < 4; ++l) __builtin_ia32_storeupd256(out + l * n + k, lane[l]);
  }
}
[[gnu::target("avx512f"), gnu::noinline]] inline void transpose(const Raw8* in, int n,
                                                                double* out) {
  constexpr Bits8 kEven{0, 8, 2, 10, 4, 12, 6, 14}, kOdd{1, 9, 3, 11, 5, 13, 7, 15},
      kPairs{0, 1, 8, 9, 4, 5, 12, 13}, kOtherPairs{2, 3, 10, 11, 6, 7, 14, 15},
      kLow{0, 1, 2, 3, 8, 9, 10, 11}, kHigh{4, 5, 6, 7, 12, 13, 14, 15};
  for (int k = 0; k < n; k += 8, in += 8) {
    Raw8 a[8], b[8];
    for (int l = 0; l < 8; l += 2) {
      a[l] = __builtin_shuffle(in[l], in[l + 1], kEven);
      a[l + 1] = __builtin_shuffle(in[l], in[l + 1], kOdd);
    }
    for (int l = 0; l < 8; l += 4) {
      for (int m = l; m < l + 2; ++m) {
        b[m] = __builtin_shuffle(a[m], a[m + 2], kPairs);
        b[m + 2] = __builtin_shuffle(a[m], a[m + 2], kOtherPairs);
      }
    }
    for (int l = 0; l < 4; ++l) {
      *(Raw8*)__builtin_assume_aligned(out + l * n + k, 64) =
          __builtin_shuffle(b[l], b[l + 4], kLow);
      *(Raw8*)__builtin_assume_aligned(out + (l + 4) * n + k, 64) =
          __builtin_shuffle(b[l], b[l + 4], kHigh);
    }
  }
}
#undef CAIRN_FOR_4
#undef CAIRN_FOR_8

/// W doubles, one for each of W factors. Like a double it converts from one, computes, compares and
/// goes into Eigen matrices.
///
/// A comparison is one answer for all lanes. Where they disagree it is that of the first lane, and
/// `diverged` is set, on this thread: then the other lanes' results are worth nothing. Who began
/// the computation does it again lane by lane, each in all lanes at once, so that code with
/// branches on data is right, if slower. `if_less` and `by_bound` do without.
template <int W>
class Pack {
 public:
  using Raw = std::conditional_t<W == 4, Raw4, Raw8>;
  Raw raw;
  static inline constinit thread_local bool diverged = false;

  // Copies are not trivial so that functions return packs in memory, whatever machine they are
  // compiled for.
  Pack() {}                            // NOLINT(modernize-use-equals-default)
  Pack(const Pack& x) : raw(x.raw) {}  // NOLINT(modernize-use-equals-default)
  Pack& operator=(const Pack& x) {     // NOLINT(modernize-use-equals-default)
    raw = x.raw;
    return *this;
  }
  Pack(double x) { fill(x, raw); }  // NOLINT(google-explicit-constructor)
  /// `mine` in one lane, `others` in the rest.
  static Pack one_lane(int lane, const Pack& mine, const Pack& others) {
    Pack r;
    double flags[W];
    for (int k = 0; k < W; ++k) flags[k] = k == lane ? -1.0 : 0.0;
    Pack flag;
    __builtin_memcpy(&flag.raw, flags, sizeof flags);
    blend(flag.raw, Pack(0.0).raw, mine.raw, others.raw, r.raw);
    return r;
  }
  /// The k-th double of each of W rows.
  Pack(const double* const* rows, int k) { collect(rows, k, raw); }
  /// The k-th and the next, in less time.
  static void load_two(const double* const* rows, int k, Pack& one, Pack& next) {
    collect_two(rows, k, one.raw, next.raw);
  }

  friend Pack operator+(const Pack& a) { return a; }
  friend Pack operator-(const Pack& a) {
    Pack r;
    negate(a.raw, r.raw);
    return r;
  }
  friend Pack operator+(const Pack& a, const Pack& b) {
    Pack r;
    add(a.raw, b.raw, r.raw);
    return r;
  }
  friend Pack operator-(const Pack& a, const Pack& b) {
    Pack r;
    subtract(a.raw, b.raw, r.raw);
    return r;
  }
  friend Pack operator*(const Pack& a, const Pack& b) {
    Pack r;
    multiply(a.raw, b.raw, r.raw);
    return r;
  }
  friend Pack operator/(const Pack& a, const Pack& b) {
    Pack r;
    divide(a.raw, b.raw, r.raw);
    return r;
  }
  Pack& operator+=(const Pack& b) { return *this = *this + b; }
  Pack& operator-=(const Pack& b) { return *this = *this - b; }
  Pack& operator*=(const Pack& b) { return *this = *this * b; }
  Pack& operator/=(const Pack& b) { return *this = *this / b; }

  friend std::partial_ordering operator<=>(const Pack& a, const Pack& b) {
    const unsigned below = less(a.raw, b.raw), above = less(b.raw, a.raw);
    if (below == kAll) return std::partial_ordering::less;
    if (above == kAll) return std::partial_ordering::greater;
    const unsigned same = equal(a.raw, b.raw);
    if (same != kAll && (below | above | same) != 0) diverged = true;
    return below & 1   ? std::partial_ordering::less
           : above & 1 ? std::partial_ordering::greater
           : same & 1  ? std::partial_ordering::equivalent
                       : std::partial_ordering::unordered;
  }
  friend bool operator==(const Pack& a, const Pack& b) {
    const unsigned same = equal(a.raw, b.raw);
    if (same != kAll && same != 0) diverged = true;
    return same & 1;
  }

  // What Eigen asks of a real scalar.
  friend const Pack& conj(const Pack& x) { return x; }
  friend const Pack& real(const Pack& x) { return x; }
  friend Pack imag(const Pack&) { return 0.0; }
  friend Pack abs2(const Pack& x) { return x * x; }

  static constexpr unsigned kAll = (1U << W) - 1;  ///< one bit for each lane
};

template <int W>
inline constexpr int kWidth<Pack<W>> = W;

using std::abs;
using std::sqrt;
template <int W>
Pack<W> sqrt(const Pack<W>& x) {
  Pack<W> r;
  square_root(x.raw, r.raw);
  return r;
}
template <int W>
Pack<W> abs(const Pack<W>& x) {
  Pack<W> r;
  absolute(x.raw, r.raw);
  return r;
}
template <int W>
bool all_within(const Pack<W>& x, double bound) {
  const Pack<W> size = abs(x), most(bound);
  return (less(size.raw, most.raw) | equal(size.raw, most.raw)) == Pack<W>::kAll;
}
template <int W>
Pack<W> if_less(const Pack<W>& a, const std::type_identity_t<Pack<W>>& b,
                const std::type_identity_t<Pack<W>>& x, const std::type_identity_t<Pack<W>>& y) {
  Pack<W> r;
  blend(a.raw, b.raw, x.raw, y.raw, r.raw);
  return r;
}
template <int W>
int is_below(const Pack<W>& x, double bound) {
  const unsigned below = less(x.raw, Pack<W>(bound).raw);
  return below == Pack<W>::kAll ? 1 : below == 0 ? 0 : -1;
}

/// c + i s times i to the power of the integer that `rounded`, a number plus 1.5 · 2⁵², rounds to.
template <int W>
void turn_quarters(const Pack<W>& rounded, Pack<W>& c, Pack<W>& s) {
  turn(rounded.raw, c.raw, s.raw);
}

// Compiled for any machine and never part of a loop over factors, so that no compiler finds
// multiplications and additions to contract in f.
template <int W, class F>
[[gnu::noinline]] Pack<W> map(const Pack<W>& x, F f) {
  Pack<W> r;
  for (int k = 0; k < W; ++k) r.raw[k] = f(x.raw[k]);
  return r;
}
template <int W, class F>
[[gnu::noinline]] Pack<W> map(const Pack<W>& x, const Pack<W>& y, F f) {
  Pack<W> r;
  for (int k = 0; k < W; ++k) r.raw[k] = f(x.raw[k], y.raw[k]);
  return r;
}

/// How many lanes the packs of this machine have: 8 with AVX-512, 4 with AVX2, 1 without. May be
/// set, to compare; the results are the same.
inline int& width() {
  static int lanes = __builtin_cpu_supports("avx512f") ? 8 : __builtin_cpu_supports("avx2") ? 4 : 1;
  return lanes;
}

#define CAIRN_EACH(NAME)                                        \
  using std::NAME;                                              \
  template <int W>                                              \
  Pack<W> NAME(const Pack<W>& x) {                              \
    return map(x, [](double lane) { return std::NAME(lane); }); \
  }
#define CAIRN_EACH_PAIR(NAME)                                                           \
  using std::NAME;                                                                      \
  template <int W>                                                                      \
  Pack<W> NAME(const Pack<W>& x, const std::type_identity_t<Pack<W>>& y) {              \
    return map(x, y, [](double lane, double other) { return std::NAME(lane, other); }); \
  }
#define CAIRN_ASK(NAME)                                                        \
  using std::NAME;                                                             \
  template <int W>                                                             \
  bool NAME(const Pack<W>& x) {                                                \
    return map(x, [](double lane) { return double(std::NAME(lane)); }) == 1.0; \
  }
#else
#define CAIRN_EACH(NAME) using std::NAME;
#define CAIRN_EACH_PAIR(NAME) using std::NAME;
#define CAIRN_ASK(NAME) using std::NAME;
using std::abs;
using std::sqrt;
#endif

CAIRN_EACH(exp)
CAIRN_EACH(log)
CAIRN_EACH(sin)
CAIRN_EACH(cos)
CAIRN_EACH(tan)
CAIRN_EACH(asin)
CAIRN_EACH(acos)
CAIRN_EACH(atan)
CAIRN_EACH(sinh)
CAIRN_EACH(cosh)
CAIRN_EACH(tanh)
CAIRN_EACH(floor)
CAIRN_EACH(ceil)
CAIRN_EACH_PAIR(atan2)
CAIRN_EACH_PAIR(hypot)
CAIRN_EACH_PAIR(pow)
CAIRN_EACH_PAIR(fmod)
CAIRN_ASK(isfinite)
CAIRN_ASK(isnan)
CAIRN_ASK(isinf)
#undef CAIRN_EACH
#undef CAIRN_EACH_PAIR
#undef CAIRN_ASK

/// The first `count` doubles, one for each lane; the last one again where there are too few.
template <class S>
S load(const double* from, std::size_t count) {
  if constexpr (kWidth<S> == 1) {
    return *from;
  } else {
    const double* places[kWidth<S>];
    for (std::size_t k = 0; k < kWidth<S>; ++k) places[k] = from + std::min(k, count - 1);
    return S(places, 0);
  }
}
/// The first `count` lanes, and no more than there are.
template <class S>
void store(const S& x, std::size_t count, double* to) {
  if constexpr (kWidth<S> == 1) {
    *to = x;
  } else {
    double all[kWidth<S>];
    __builtin_memcpy(all, &x.raw, sizeof all);
    for (std::size_t k = 0; k < std::min<std::size_t>(count, kWidth<S>); ++k) to[k] = all[k];
  }
}

/// N doubles, a power of two, of one lane: to = from, or to += from.
template <class S, int N>
[[gnu::always_inline]] inline void put(const double* from, bool adds, double* to) {
#if CAIRN_PACKS
  if constexpr (kWidth<S> == 8) return put_for_8<N>(from, adds, to);
  if constexpr (kWidth<S> == 4) return put_for_4<N>(from, adds, to);
#endif
  for (int k = 0; k < N; ++k) to[k] = adds ? to[k] + from[k] : from[k];
}

/// N packs by lanes: N doubles for each. N is a multiple of the number of lanes.
template <class S, int N>
class Separate {
 public:
  explicit Separate(const S* numbers) { transpose(&numbers->raw, N, values_); }
  const double* lane(std::size_t k) const { return values_ + k * N; }

 private:
  alignas(64) double values_[kWidth<S> * N];
};
template <int N>
class Separate<double, N> {
 public:
  explicit Separate(const double* numbers) : values_(numbers) {}
  const double* lane(std::size_t) const { return values_; }

 private:
  const double* values_;
};

/// below() where x < bound, else above(); x is a double, a pack or a dual number of either. Either
/// is called only if a lane needs it, so both may divide by what is zero on the other's side.
template <class S, class Below, class Above>
S by_bound(const S& x, double bound, Below below, Above above) {
  const int side = is_below(x, bound);
  if (side == 0) return above();
  if (side == 1) return below();
  return if_less(x, S(bound), S(below()), S(above()));
}

}  // namespace cairn::lanes

#if CAIRN_PACKS
namespace Eigen {

template <int W>
struct NumTraits<cairn::lanes::Pack<W>> : GenericNumTraits<double> {
  using Real = cairn::lanes::Pack<W>;
  using NonInteger = Real;
  using Nested = Real;
  using Literal = Real;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
  static Real epsilon() { return std::numeric_limits<double>::epsilon(); }
  static Real dummy_precision() { return 1e-12; }
  static Real highest() { return std::numeric_limits<double>::max(); }
  static Real lowest() { return std::numeric_limits<double>::lowest(); }
};

// Matrices of plain numbers and of packs mix.
template <int W, class Operation>
struct ScalarBinaryOpTraits<cairn::lanes::Pack<W>, double, Operation> {
  using ReturnType = cairn::lanes::Pack<W>;
};
template <int W, class Operation>
struct ScalarBinaryOpTraits<double, cairn::lanes::Pack<W>, Operation> {
  using ReturnType = cairn::lanes::Pack<W>;
};

}  // namespace Eigen
#endif
