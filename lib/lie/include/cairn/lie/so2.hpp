// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>

#include <Eigen/Core>

#include "cairn/pack/pack.hpp"

/// Plane rotations, held as an angle [rad]. S is double, a pack of them or a dual number of either.
namespace cairn::so2 {

template <class S>
using Vector2 = Eigen::Matrix<S, 2, 1>;
template <class S>
using Matrix2 = Eigen::Matrix<S, 2, 2>;

/// The same angle within [−π, π]. A dual number keeps its derivative. Accurate for any finite
/// angle: the remainder is exact, so no error grows with the number of turns.
template <class S>
S wrap_angle(const S& angle) {
  if constexpr (std::is_same_v<S, double>) {
    if (angle <= std::numbers::pi && angle >= -std::numbers::pi) return angle;
    return std::remainder(angle, 2.0 * std::numbers::pi);
  } else if constexpr (lanes::kWidth<S> > 1) {
    if (lanes::all_within(angle, std::numbers::pi)) return angle;
    return map(angle, wrap_angle<double>);
  } else {
    if (lanes::all_within(angle.value, std::numbers::pi)) return angle;
    S wrapped = angle;
    wrapped.value = lanes::map(angle.value, [](double lane) {
      return std::abs(lane) <= std::numbers::pi ? lane : lane + (wrap_angle<double>(lane) - lane);
    });
    return wrapped;
  }
}

/// Cosine and sine together, to 1e-16: reduction to [−π/4, π/4] with π/2 in three parts, then their
/// series. Inlined into loops about many angles, it takes a third of the time of the C library's,
/// to which it leaves angles beyond 1000. T is double or a pack of them.
template <class T>
[[gnu::always_inline]] inline void cos_sin(const T& angle, T& c, T& s) {
  if (!lanes::all_within(angle, 1000.0)) {
    if constexpr (std::is_same_v<T, double>) {
      c = std::cos(angle);
      s = std::sin(angle);
    } else {
      c = map(angle, [](double lane) {
        double cosine, sine;
        cos_sin<double>(lane, cosine, sine);
        return cosine;
      });
      s = map(angle, [](double lane) {
        double cosine, sine;
        cos_sin<double>(lane, cosine, sine);
        return sine;
      });
    }
    return;
  }
  constexpr double kRound = 0x1.8p52;  // adding and subtracting it rounds to an integer
  const T rounded = angle * (2.0 / std::numbers::pi) + kRound;
  const T turns = rounded - kRound;
  // The first two parts have so few bits that their products with `turns` are exact.
  const T r = ((angle - turns * 0x1.921fb544p+0) - turns * 0x1.0b4611a6p-34) -
              turns * 0x1.3198a2e037073p-69;
  const T q = r * r;
  const T sine =
      r + r * q *
              (-1.0 / 6 +
               q * (1.0 / 120 + q * (-1.0 / 5040 +
                                     q * (1.0 / 362880 + q * (-1.0 / 39916800 +
                                                              q * (1.0 / 6227020800 +
                                                                   q * (-1.0 / 1307674368000)))))));
  const T cosine =
      (1.0 - 0.5 * q) +
      q * q *
          (1.0 / 24 +
           q * (-1.0 / 720 +
                q * (1.0 / 40320 + q * (-1.0 / 3628800 + q * (1.0 / 479001600 +
                                                              q * (-1.0 / 87178291200 +
                                                                   q * (1.0 / 20922789888000)))))));
  if constexpr (std::is_same_v<T, double>) {
    const int quarter = static_cast<int>(turns) & 3;
    const double even = quarter & 1 ? sine : cosine, odd = quarter & 1 ? cosine : sine;
    c = quarter == 1 || quarter == 2 ? -even : even;
    s = quarter >= 2 ? -odd : odd;
  } else {
    c = cosine;
    s = sine;
    turn_quarters(rounded, c, s);
  }
}

/// The angle of (x, y), as atan2(y, x), to three units in the last place; 0 where both are zero.
/// Inlined into loops about many points, it takes a fifth of the time of the C library's.
///
/// The vector is reflected to an angle in [0, π/4] and turned back by 0, π/8 or π/4, so that its
/// tangent is at most tan π/16; there (atan q − q)/q³ is a polynomial in q², by Chebyshev
/// interpolation, to 1e-17.
template <class S>
[[gnu::always_inline]] inline S polar_angle(const S& y, const S& x) {
  if constexpr (std::is_same_v<S, double> || lanes::kWidth < S >> 1) {
    using lanes::abs, lanes::if_less;
    const S zero(0.0), a = abs(x), b = abs(y);
    const S large = if_less(a, b, b, a), small = if_less(a, b, a, b);
    // Which part of π/8 the vector is turned by: its tangent, and the angle in two parts.
    const S low = large * 0.19891236737965798, high = large * 0.668178637919299;
    const auto choose = [&](double at_eighth, double at_quarter) {
      return if_less(high, small, S(at_quarter), if_less(low, small, S(at_eighth), zero));
    };
    const S tangent = choose(0x1.a827999fcef32p-2, 1.0);
    const S turned = choose(0x1.921fb54442d18p-2, 0x1.921fb54442d18p-1);
    const S rest = choose(0x1.c398861b78b55p-59, 0x1.1a62633145c07p-55);
    const S below = large + small * tangent;
    constexpr double kLeast = std::numeric_limits<double>::min();
    const S q = (small - large * tangent) / if_less(below, S(kLeast), S(kLeast), below);
    const S z = q * q;
    const S series =
        -0.3333333333333333 +
        z * (0.19999999999997287 +
             z * (-0.14285714284272708 +
                  z * (0.11111110818855931 +
                       z * (-0.0909087994065675 +
                            z * (0.0769072401685326 +
                                 z * (-0.06618723421715132 + z * 0.051156755232583236))))));
    S angle = turned + (rest + (q + q * z * series));
    constexpr double kHalf = 0x1.921fb54442d18p+0, kHalfRest = 0x1.1a62633145c07p-54;
    angle = if_less(a, b, (kHalf - angle) + kHalfRest, angle);
    angle = if_less(x, zero, (2.0 * kHalf - angle) + 2.0 * kHalfRest, angle);
    return if_less(y, zero, -angle, angle);
  } else {
    // A dual number: the same value to the last bit, and its derivatives.
    S angle = atan2(y, x);
    angle.value = polar_angle(y.value, x.value);
    return angle;
  }
}

/// Cosine and sine of an angle: a rotation ready for use.
template <class S>
struct Rotation {
  S c, s;

  [[gnu::always_inline]] explicit Rotation(const S& angle) {
    if constexpr (std::is_same_v<S, double> || lanes::kWidth < S >> 1) {
      cos_sin(angle, c, s);
    } else {
      // A dual number: the same values to the last bit, and their derivatives.
      decltype(S::value) cosine, sine;
      cos_sin(angle.value, cosine, sine);
      const S change = angle - angle.value;
      c = cosine - sine * change;
      s = sine + cosine * change;
    }
  }
  /// R v
  template <class V>
  Vector2<S> operator*(const V& v) const {
    return {c * v[0] - s * v[1], s * v[0] + c * v[1]};
  }
  /// Rᵀ v
  template <class V>
  Vector2<S> inverse_times(const V& v) const {
    return {c * v[0] + s * v[1], c * v[1] - s * v[0]};
  }
  Matrix2<S> matrix() const {
    Matrix2<S> R;
    R << c, -s, s, c;
    return R;
  }
};

}  // namespace cairn::so2

namespace cairn {
using so2::wrap_angle;
}  // namespace cairn
