// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/lie/se3.hpp"
#include "cairn/types/define_variable.hpp"

/// How an error pose E = (t, q), which is the identity when a measurement fits, becomes six
/// numbers. Tools differ here, and so do their chi2. A metric is a struct with
///  - `error<S>(E)`;
///  - `derivative(E, D)`: the error again, and its derivative along E exp(δ).
namespace cairn::slam3d {

/// d error / dδ for E exp(δ), by blocks: [translation cross; 0 rotation].
struct ErrorDerivative {
  Eigen::Matrix3d translation, cross, rotation;
};

namespace detail {

inline Eigen::Matrix<double, 6, 1> join(const Eigen::Vector3d& head, const Eigen::Vector3d& tail) {
  return {head[0], head[1], head[2], tail[0], tail[1], tail[2]};
}

/// a I + [v]ₓ + b v vᵀ
inline Eigen::Matrix3d rodrigues_like(double a, const Eigen::Vector3d& v, double b) {
  const Eigen::Vector3d bv = b * v;
  const double xy = bv[0] * v[1], xz = bv[0] * v[2], yz = bv[1] * v[2];
  Eigen::Matrix3d M;
  M << a + bv[0] * v[0], xy - v[2], xz + v[1],  //
      xy + v[2], a + bv[1] * v[1], yz - v[0],   //
      xz - v[1], yz + v[0], a + bv[2] * v[2];
  return M;
}

/// The rotation vector of a unit quaternion, with what the inverse Jacobians take from it.
struct RotationVector {
  Eigen::Vector3d omega;
  double square;      // θ²
  double factor;      // d(θ²) = (1 − (θ/2) cot(θ/2)) / θ²
  double derivative;  // of d with respect to θ²

  explicit RotationVector(const Eigen::Vector4d& q) {
    const double sign = q[3] < 0.0 ? -1.0 : 1.0, w = sign * q[3];
    const Eigen::Vector3d v(q[0], q[1], q[2]);
    const double n2 = v.squaredNorm();  // sin²(θ/2)
    const double scale = so3::log_factor<double>(n2, w);
    omega = (sign * scale) * v;
    square = scale * scale * n2;
    if (square < 1e-2) {
      // The Taylor series of the two closed forms below.
      const double u = square;
      factor = 1.0 / 12 +
               u * (1.0 / 720 + u * (1.0 / 30240 + u * (1.0 / 1209600 + u * (1.0 / 47900160))));
      derivative = 1.0 / 720 + u * (1.0 / 15120 + u * (1.0 / 403200 + u * (1.0 / 11975040)));
    } else {
      const double half_by_sine = 0.5 * scale;  // (θ/2) / sin(θ/2)
      factor = (1.0 - half_by_sine * w) / square;
      // ((h² / sin² h − h cot h) / (2 θ²) − d) / θ² with h = θ/2
      derivative = (0.5 * half_by_sine * (half_by_sine - w) / square - factor) / square;
    }
  }

  /// J_r⁻¹(ω) = (1 − d θ²) I + ½ [ω]ₓ + d ω ωᵀ
  Eigen::Matrix3d inverse_right_jacobian() const {
    return rodrigues_like(1.0 - factor * square, 0.5 * omega, 4.0 * factor);
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
  static Vector<double, 6> derivative(const Vector<double, 7>& E, ErrorDerivative& D) {
    const detail::RotationVector r(Se3::quaternion<double>(E));
    const Eigen::Vector3d t = Se3::translation<double>(E), &phi = r.omega;
    const Eigen::Vector3d once = so3::cross<double>(phi, t), twice = so3::cross<double>(phi, once);
    Eigen::Matrix3d G = so3::hat<double>(0.5 * t);
    const Eigen::Vector3d dphi = r.factor * phi;
    G.noalias() += dphi * t.transpose();
    G.noalias() += (2.0 * (r.derivative * twice - r.factor * t)) * phi.transpose();
    G.diagonal().array() += dphi.dot(t);
    D.rotation = r.inverse_right_jacobian();
    D.translation = D.rotation;
    D.cross.noalias() = G.lazyProduct(D.rotation);
    return detail::join(t - 0.5 * once + r.factor * twice, phi);
  }
};

/// Translation and the vector part of the unit quaternion with w ≥ 0 (half the angle, for small
/// ones), as g2o has it.
struct QuaternionVector {
  static constexpr std::string_view kName = "g2o";

  template <class S>
  static Vector<S, 6> error(const Vector<S, 7>& E) {
    Vector<S, 6> e;
    for (int k = 0; k < 6; ++k) e[k] = k >= 3 && E[6] < 0.0 ? -E[k] : E[k];
    return e;
  }
  static Vector<double, 6> derivative(const Vector<double, 7>& E, ErrorDerivative& D) {
    const double half = E[6] < 0.0 ? -0.5 : 0.5;
    D.translation = so3::matrix<double>(Se3::quaternion<double>(E));
    D.rotation = detail::rodrigues_like(half * E[6], half * E.segment<3>(3), 0.0);
    D.cross.setZero();
    return error<double>(E);
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
  static Vector<double, 6> derivative(const Vector<double, 7>& E, ErrorDerivative& D) {
    const detail::RotationVector r(Se3::quaternion<double>(E));
    D.translation = so3::matrix<double>(Se3::quaternion<double>(E));
    D.rotation = r.inverse_right_jacobian();
    D.cross.setZero();
    return detail::join(Se3::translation<double>(E), r.omega);
  }
};

}  // namespace cairn::slam3d
