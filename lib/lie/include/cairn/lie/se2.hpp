// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/lie/so2.hpp"
#include "cairn/types/define_variable.hpp"

namespace cairn {

/// A pose in the plane: x y [m], theta [rad]; tangent (rho_x, rho_y, phi).
/// retract(x, δ) = x exp(δ) with the exponential of the group (a body that moves with a constant
/// twist), and local is its inverse.
struct Se2 {
  static constexpr std::string_view kTag = "VERTEX_SE2";
  static constexpr int kAmbient = 3, kTangent = 3;
  static constexpr int kDimension = 2;
  static constexpr bool kOriented = true;
  static constexpr bool kPacks = true;

  static Vector<double, 3> identity() { return Vector<double, 3>::Zero(); }

  template <class S>
  static Vector<S, 3> compose(const Vector<S, 3>& a, const Vector<S, 3>& b) {
    const so2::Rotation<S> R(a[2]);
    return {a[0] + (R.c * b[0] - R.s * b[1]), a[1] + (R.s * b[0] + R.c * b[1]),
            wrap_angle<S>(a[2] + b[2])};
  }
  template <class S>
  static Vector<S, 3> inverse(const Vector<S, 3>& a) {
    const so2::Rotation<S> R(a[2]);
    return {-(R.c * a[0] + R.s * a[1]), R.s * a[0] - R.c * a[1], -a[2]};
  }
  /// a⁻¹ b
  template <class S>
  static Vector<S, 3> between(const Vector<S, 3>& a, const Vector<S, 3>& b) {
    const so2::Rotation<S> R(a[2]);
    const S dx = b[0] - a[0], dy = b[1] - a[1];
    return {R.c * dx + R.s * dy, R.c * dy - R.s * dx, wrap_angle<S>(b[2] - a[2])};
  }
  static Eigen::Matrix3d adjoint(const Vector<double, 3>& a) {
    const so2::Rotation<double> R(a[2]);
    Eigen::Matrix3d Ad;
    Ad << R.c, -R.s, a[1], R.s, R.c, -a[0], 0, 0, 1;
    return Ad;
  }

  /// t = V(φ) ρ with V = [A −B; B A], A = sin φ/φ, B = (1 − cos φ)/φ, both without cancellation.
  template <class S>
  static Vector<S, 3> exp(const Vector<S, 3>& delta) {
    using std::cos;
    using std::sin;
    const S& phi = delta[2];
    const S square = phi * phi;
    const S A = lanes::by_bound(
        square, 1e-4,
        [&] { return 1.0 - square * ((1.0 / 6) - square * ((1.0 / 120) - square * (1.0 / 5040))); },
        [&] {
          const S half = phi * 0.5;
          return sin(half) * 2.0 / phi * cos(half);
        });
    const S B = lanes::by_bound(
        square, 1e-4,
        [&] {
          return phi * ((1.0 / 2) -
                        square * ((1.0 / 24) - square * ((1.0 / 720) - square * (1.0 / 40320))));
        },
        [&] {
          const S s = sin(phi * 0.5);
          return s * 2.0 / phi * s;
        });
    return {A * delta[0] - B * delta[1], B * delta[0] + A * delta[1], wrap_angle<S>(phi)};
  }
  /// ρ = V⁻¹ t, V⁻¹ = [a h; −h a] with h = φ/2, a = h cot h.
  template <class S>
  static Vector<S, 3> log(const Vector<S, 3>& x) {
    using std::cos;
    using std::sin;
    const S phi = wrap_angle<S>(x[2]);
    const S h = phi * 0.5;
    const S square = phi * phi;
    const S a = lanes::by_bound(
        square, 1e-4,
        [&] {
          return 1.0 - square * ((1.0 / 12) + square * ((1.0 / 720) + square * (1.0 / 30240)));
        },
        [&] { return h * cos(h) / sin(h); });
    return {a * x[0] + h * x[1], a * x[1] - h * x[0], phi};
  }

  template <class S>
  static Vector<S, 3> retract(const Vector<S, 3>& x, const Vector<S, 3>& delta) {
    return compose<S>(x, exp<S>(delta));
  }
  template <class S>
  static Vector<S, 3> local(const Vector<S, 3>& x, const Vector<S, 3>& y) {
    return log<S>(between<S>(x, y));
  }

  /// The right Jacobian of exp at δ, wherever x is: [A B · ; −B A · ; 0 0 1] with A and B as in
  /// `exp`.
  static Eigen::Matrix3d retract_jacobian(const Vector<double, 3>&,
                                          const Vector<double, 3>& delta) {
    const double phi = delta[2], square = phi * phi;
    double A, B, b, c;  // b = (1 − cos φ)/φ², c = (φ − sin φ)/φ²
    if (square < 1e-4) {
      A = 1.0 - square * ((1.0 / 6) - square * ((1.0 / 120) - square * (1.0 / 5040)));
      b = (1.0 / 2) - square * ((1.0 / 24) - square * ((1.0 / 720) - square * (1.0 / 40320)));
      B = phi * b;
      c = phi * ((1.0 / 6) - square * ((1.0 / 120) - square * (1.0 / 5040)));
    } else {
      const double s = std::sin(phi), versine = 2.0 * std::pow(std::sin(0.5 * phi), 2);
      A = s / phi;
      B = versine / phi;
      b = versine / square;
      c = (phi - s) / square;
    }
    Eigen::Matrix3d D;
    D << A, B, c * delta[0] - b * delta[1],  //
        -B, A, b * delta[0] + c * delta[1],  //
        0, 0, 1;
    return D;
  }

  static std::string normalize(Vector<double, 3>& x) {
    if (!x.allFinite()) return "a coordinate is not finite";
    x[2] = wrap_angle(x[2]);
    return {};
  }
  static Eigen::Matrix2d rotation(const Vector<double, 3>& x) {
    return so2::Rotation<double>(x[2]).matrix();
  }
  static Vector<double, 2> position(const Vector<double, 3>& x) { return x.head<2>(); }
  static Vector<double, 3> from_placement(const Eigen::Matrix2d& R, const Vector<double, 2>& t) {
    return {t[0], t[1], std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1))};
  }
};

}  // namespace cairn
