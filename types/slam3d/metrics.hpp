// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/lie/se3.hpp"
#include "cairn/types/define_variable.hpp"

/// How an error pose E = (t, q), which is the identity when a measurement fits, becomes six
/// numbers. Tools differ here, and so do their chi2. A metric is a struct with
///  - `error<S>(E)`;
///  - `derivative<S>(E, D)`: the error again, and its derivative along E exp(δ).
namespace cairn::slam3d {

/// d error / dδ for E exp(δ), by blocks: [translation cross; 0 rotation].
template <class S>
struct ErrorDerivative {
  so3::Matrix3<S> translation, cross, rotation;

  void assemble(Eigen::Matrix<S, 6, 6>& J) const {
    for (int c = 0; c < 3; ++c) {
      for (int row = 0; row < 3; ++row) {
        J(row, c) = translation(row, c);
        J(row, 3 + c) = cross(row, c);
        J(3 + row, c) = 0.0;
        J(3 + row, 3 + c) = rotation(row, c);
      }
    }
  }
};

namespace detail {

template <class S>
Vector<S, 6> join(const Vector<S, 3>& head, const Vector<S, 3>& tail) {
  return {head[0], head[1], head[2], tail[0], tail[1], tail[2]};
}

template <class S>
so3::Matrix3<S> zero() {
  so3::Matrix3<S> Z;
  for (int k = 0; k < 9; ++k) Z.data()[k] = 0.0;
  return Z;
}

/// a I + [v]ₓ + b v vᵀ
template <class S>
so3::Matrix3<S> rodrigues_like(const S& a, const Vector<S, 3>& v, const S& b) {
  const Vector<S, 3> bv = v * b;
  const S xy = bv[0] * v[1], xz = bv[0] * v[2], yz = bv[1] * v[2];
  so3::Matrix3<S> M;
  M << a + bv[0] * v[0], xy - v[2], xz + v[1],  //
      xy + v[2], a + bv[1] * v[1], yz - v[0],   //
      xz - v[1], yz + v[0], a + bv[2] * v[2];
  return M;
}

/// The rotation vector of a unit quaternion, with what the inverse Jacobians take from it.
template <class S>
struct RotationVector {
  Vector<S, 3> omega;
  S square;      // θ²
  S factor;      // d(θ²) = (1 − (θ/2) cot(θ/2)) / θ²
  S derivative;  // of d with respect to θ²

  explicit RotationVector(const Vector<S, 4>& q) {
    using lanes::if_less;
    const S sign = if_less(q[3], 0.0, -1.0, 1.0), w = sign * q[3];
    const S n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];  // sin²(θ/2)
    const S scale = so3::log_factor<S>(n2, w);
    const S along = sign * scale;
    omega = {along * q[0], along * q[1], along * q[2]};
    square = scale * scale * n2;
    // Taylor series of the two closed forms that stand below them.
    const S u = square, half_by_sine = 0.5 * scale;  // (θ/2) / sin(θ/2)
    factor = lanes::by_bound(
        u, 1e-2,
        [&] {
          return 1.0 / 12 +
                 u * (1.0 / 720 + u * (1.0 / 30240 + u * (1.0 / 1209600 + u * (1.0 / 47900160))));
        },
        [&] { return (1.0 - half_by_sine * w) / u; });
    // ((h² / sin² h − h cot h) / (2 θ²) − d) / θ² with h = θ/2
    derivative = lanes::by_bound(
        u, 1e-2,
        [&] { return 1.0 / 720 + u * (1.0 / 15120 + u * (1.0 / 403200 + u * (1.0 / 11975040))); },
        [&] { return (0.5 * half_by_sine * (half_by_sine - w) / u - factor) / u; });
  }

  /// J_r⁻¹(ω) = (1 − d θ²) I + ½ [ω]ₓ + d ω ωᵀ
  so3::Matrix3<S> inverse_right_jacobian() const {
    return rodrigues_like<S>(1.0 - factor * square, omega * S(0.5), 4.0 * factor);
  }
};

}  // namespace detail

/// The logarithm of the group, (ρ, φ) = log(E), as GTSAM has it.
struct Logarithm {
  static constexpr std::string_view kName = "logarithm";

  template <class S>
  static Vector<S, 6> error(const Vector<S, 7>& E) {
    return Se3::log<S>(E);
  }
  /// ρ = J_l⁻¹(φ) t = t − ½ φ×t + d φ×(φ×t), hence with G = ∂ρ/∂φ at fixed t:
  /// dρ = J_l⁻¹ R dρ_δ + G J_r⁻¹ dφ_δ, and J_l⁻¹ R = J_r⁻¹.
  template <class S>
  static Vector<S, 6> derivative(const Vector<S, 7>& E, ErrorDerivative<S>& D) {
    const detail::RotationVector<S> r(Se3::quaternion<S>(E));
    const Vector<S, 3> t = Se3::translation<S>(E), &phi = r.omega;
    const Vector<S, 3> once = so3::cross<S>(phi, t), twice = so3::cross<S>(phi, once);
    so3::Matrix3<S> G = so3::hat<S>(t * S(0.5));
    const Vector<S, 3> dphi = phi * r.factor,
                       along = (twice * r.derivative - t * r.factor) * S(2.0);
    const S both = dphi[0] * t[0] + dphi[1] * t[1] + dphi[2] * t[2];
    for (int c = 0; c < 3; ++c) {
      for (int row = 0; row < 3; ++row) G(row, c) += dphi[row] * t[c] + along[row] * phi[c];
      G(c, c) += both;
    }
    D.rotation = r.inverse_right_jacobian();
    D.translation = D.rotation;
    D.cross = so3::times<S>(G, D.rotation);
    return detail::join<S>(t - once * S(0.5) + twice * r.factor, phi);
  }
};

/// Translation and the vector part of the unit quaternion with w ≥ 0 (half the angle, for small
/// ones), as g2o has it.
struct QuaternionVector {
  static constexpr std::string_view kName = "g2o";

  template <class S>
  static Vector<S, 6> error(const Vector<S, 7>& E) {
    using lanes::if_less;
    Vector<S, 6> e;
    for (int k = 0; k < 6; ++k) e[k] = k < 3 ? E[k] : if_less(E[6], 0.0, -E[k], E[k]);
    return e;
  }
  template <class S>
  static Vector<S, 6> derivative(const Vector<S, 7>& E, ErrorDerivative<S>& D) {
    using lanes::if_less;
    const S half = if_less(E[6], 0.0, -0.5, 0.5);
    D.translation = so3::matrix<S>(Se3::quaternion<S>(E));
    D.rotation = detail::rodrigues_like<S>(
        half * E[6], Vector<S, 3>(half * E[3], half * E[4], half * E[5]), 0.0);
    D.cross = detail::zero<S>();
    return error<S>(E);
  }
};

/// Translation and the rotation vector.
struct TranslationAndRotationVector {
  static constexpr std::string_view kName = "rotation_vector";

  template <class S>
  static Vector<S, 6> error(const Vector<S, 7>& E) {
    const Vector<S, 3> omega = so3::log<S>(Se3::quaternion<S>(E));
    return {E[0], E[1], E[2], omega[0], omega[1], omega[2]};
  }
  template <class S>
  static Vector<S, 6> derivative(const Vector<S, 7>& E, ErrorDerivative<S>& D) {
    const detail::RotationVector<S> r(Se3::quaternion<S>(E));
    D.translation = so3::matrix<S>(Se3::quaternion<S>(E));
    D.rotation = r.inverse_right_jacobian();
    D.cross = detail::zero<S>();
    return detail::join<S>(Se3::translation<S>(E), r.omega);
  }
};

}  // namespace cairn::slam3d
