// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <numbers>
#include <type_traits>

#include <Eigen/Core>

/// Plane rotations, held as an angle [rad]. S is double or a dual number.
namespace cairn::so2 {

template <class S>
using Vector2 = Eigen::Matrix<S, 2, 1>;
template <class S>
using Matrix2 = Eigen::Matrix<S, 2, 2>;

/// The same angle within [−π, π]. A dual number keeps its derivative. Accurate for any finite
/// angle: the remainder is exact, so no error grows with the number of turns.
template <class S>
S wrap_angle(const S& angle) {
  if (angle <= std::numbers::pi && angle >= -std::numbers::pi) return angle;
  if constexpr (std::is_same_v<S, double>) {
    return std::remainder(angle, 2.0 * std::numbers::pi);
  } else {
    return angle + (wrap_angle(angle.value) - angle.value);
  }
}

/// Cosine and sine of an angle: a rotation ready for use.
template <class S>
struct Rotation {
  S c, s;

  explicit Rotation(const S& angle) {
    using std::cos;
    using std::sin;
    c = cos(angle);
    s = sin(angle);
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
