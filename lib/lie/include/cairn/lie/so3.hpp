// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/pack/pack.hpp"

/// Rotations of space as unit quaternions (x, y, z, w) and rotation vectors ω [rad], ‖ω‖ ≤ π.
/// S is double, a pack of them or a dual number of either. Closed forms lose digits or divide by
/// zero at small angles; there the Taylor series stand in, long enough to be exact to the last bit
/// where they take over. Formulas: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation
/// in robotics", 2018.
namespace cairn::so3 {

template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;
template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;
/// (x, y, z, w): the order of files.
template <class S>
using Quaternion = Eigen::Matrix<S, 4, 1>;

/// [a]ₓ: [a]ₓ b = a × b.
template <class S>
Matrix3<S> hat(const Vector3<S>& a) {
  Matrix3<S> A;
  A << S(0), -a[2], a[1], a[2], S(0), -a[0], -a[1], a[0], S(0);
  return A;
}

template <class S>
Vector3<S> cross(const Vector3<S>& a, const Vector3<S>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// A B and A v, every sum from its first term to its last. Eigen's order depends on the scalar.
template <class S, int N>
Eigen::Matrix<S, 3, N> times(const Matrix3<S>& A, const Eigen::Matrix<S, 3, N>& B) {
  Eigen::Matrix<S, 3, N> product;
  for (int c = 0; c < N; ++c) {
    for (int row = 0; row < 3; ++row)
      product(row, c) = A(row, 0) * B(0, c) + A(row, 1) * B(1, c) + A(row, 2) * B(2, c);
  }
  return product;
}

template <class S>
Quaternion<S> multiply(const Quaternion<S>& a, const Quaternion<S>& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
          a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

template <class S>
Quaternion<S> conjugate(const Quaternion<S>& q) {
  return {-q[0], -q[1], -q[2], q[3]};
}

/// R(q) v
template <class S>
Vector3<S> rotate(const Quaternion<S>& q, const Vector3<S>& v) {
  const Vector3<S> u(q[0], q[1], q[2]);
  const Vector3<S> twice = cross<S>(u, v) * 2.0;
  return v + twice * q[3] + cross<S>(u, twice);
}

/// R(q)ᵀ v
template <class S>
Vector3<S> rotate_back(const Quaternion<S>& q, const Vector3<S>& v) {
  const Vector3<S> u(q[0], q[1], q[2]);
  const Vector3<S> twice = cross<S>(v, u) * 2.0;
  return v + twice * q[3] + cross<S>(twice, u);
}

/// R(q)
template <class S>
Matrix3<S> matrix(const Quaternion<S>& q) {
  const S x2 = q[0] + q[0], y2 = q[1] + q[1], z2 = q[2] + q[2];
  const S xx = q[0] * x2, yy = q[1] * y2, zz = q[2] * z2;
  const S xy = q[0] * y2, xz = q[0] * z2, yz = q[1] * z2;
  const S wx = q[3] * x2, wy = q[3] * y2, wz = q[3] * z2;
  Matrix3<S> R;
  R << 1.0 - (yy + zz), xy - wz, xz + wy,  //
      xy + wz, 1.0 - (xx + zz), yz - wx,   //
      xz - wy, yz + wx, 1.0 - (xx + yy);
  return R;
}

/// The unit quaternion, w ≥ 0, of the rotation nearest to R.
inline Quaternion<double> from_matrix(const Matrix3<double>& R) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(R).normalized();
  return q.w() < 0 ? Quaternion<double>(-q.coeffs()) : Quaternion<double>(q.coeffs());
}

/// The quaternion of R = R_z(yaw) R_y(pitch) R_x(roll), angles in rad.
inline Quaternion<double> from_roll_pitch_yaw(double roll, double pitch, double yaw) {
  const double cr = std::cos(0.5 * roll), sr = std::sin(0.5 * roll);
  const double cp = std::cos(0.5 * pitch), sp = std::sin(0.5 * pitch);
  const double cy = std::cos(0.5 * yaw), sy = std::sin(0.5 * yaw);
  return {sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
          cr * cp * cy + sr * sp * sy};
}

/// (roll, pitch, yaw) [rad] with R(q) = R_z(yaw) R_y(pitch) R_x(roll), pitch within [−π/2, π/2].
inline Vector3<double> to_roll_pitch_yaw(const Quaternion<double>& q) {
  const Matrix3<double> R = matrix<double>(q);
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2)));
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

/// Undoes the rounding of a quaternion that is a unit but for some last bits; no square root.
template <class S>
void renormalize(Quaternion<S>& q) {
  const S factor = (3.0 - (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])) * 0.5;
  for (int k = 0; k < 4; ++k) q[k] = q[k] * factor;
}

template <class S>
Quaternion<S> exp(const Vector3<S>& omega) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  const S square = omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2];
  S w, factor;  // factor = sin(θ/2) / θ
  if (square < 1e-4) {
    const S h = square * 0.25;
    w = 1.0 - h * ((1.0 / 2) - h * ((1.0 / 24) - h * (1.0 / 720)));
    factor = 0.5 - h * ((1.0 / 12) - h * ((1.0 / 240) - h * (1.0 / 10080)));
  } else {
    const S theta = sqrt(square);
    const S half = theta * 0.5;
    w = cos(half);
    factor = sin(half) / theta;
  }
  return {omega[0] * factor, omega[1] * factor, omega[2] * factor, w};
}

/// ω = factor · (x, y, z) for a unit quaternion with w ≥ 0; `square` = x² + y² + z².
template <class S>
S log_factor(const S& square, const S& w) {
  using std::atan2;
  using std::sqrt;
  return lanes::by_bound(
      square, 1e-4,
      [&] {  // 2 atan(n/w)/n
        const S t = square / (w * w);
        return (1.0 - t * ((1.0 / 3) - t * ((1.0 / 5) - t * ((1.0 / 7) - t * (1.0 / 9))))) *
               (2.0 / w);
      },
      [&] {
        const S n = sqrt(square);
        return atan2(n, w) * 2.0 / n;
      });
}

/// The shortest rotation vector of a unit quaternion: ‖ω‖ ≤ π, the same for q and −q.
template <class S>
Vector3<S> log(const Quaternion<S>& q) {
  using lanes::if_less;
  const S sign = if_less(q[3], 0.0, -1.0, 1.0);
  const S square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
  const S factor = log_factor<S>(square, q[3] * sign) * sign;
  return {q[0] * factor, q[1] * factor, q[2] * factor};
}

/// (1 − cos θ)/θ² and (θ − sin θ)/θ³ of the square θ².
template <class S>
struct JacobianFactors {
  S b, c;

  explicit JacobianFactors(const S& square) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    if (square < 1e-2) {
      b = (1.0 / 2) -
          square * ((1.0 / 24) -
                    square * ((1.0 / 720) - square * ((1.0 / 40320) - square * (1.0 / 3628800))));
      c = (1.0 / 6) -
          square * ((1.0 / 120) - square * ((1.0 / 5040) -
                                            square * ((1.0 / 362880) - square * (1.0 / 39916800))));
    } else {
      const S theta = sqrt(square);
      const S half = sin(theta * 0.5);
      b = half * half * 2.0 / square;
      c = (theta - sin(theta)) / (square * theta);
    }
  }
};

/// J_l(ω) v without forming the matrix; J_l = I + b [ω]ₓ + c [ω]ₓ².
template <class S>
Vector3<S> left_jacobian_times(const Vector3<S>& omega, const Vector3<S>& v) {
  const JacobianFactors<S> f(omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]);
  const Vector3<S> turned = cross<S>(omega, v);
  return v + turned * f.b + cross<S>(omega, turned) * f.c;
}

/// (1 − (θ/2) cot(θ/2))/θ² of the square θ² ≤ π².
template <class S>
S inverse_jacobian_factor(const S& square) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  return lanes::by_bound(
      square, 1e-2,
      [&] {
        return (1.0 / 12) +
               square * ((1.0 / 720) +
                         square * ((1.0 / 30240) +
                                   square * ((1.0 / 1209600) + square * (1.0 / 47900160))));
      },
      [&] {
        const S half = sqrt(square) * 0.5;
        return (1.0 - half * cos(half) / sin(half)) / square;
      });
}

/// J_l⁻¹(ω) v; J_l⁻¹ = I − ½ [ω]ₓ + d [ω]ₓ².
template <class S>
Vector3<S> inverse_left_jacobian_times(const Vector3<S>& omega, const Vector3<S>& v) {
  const S d =
      inverse_jacobian_factor<S>(omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]);
  const Vector3<S> turned = cross<S>(omega, v);
  return v - turned * 0.5 + cross<S>(omega, turned) * d;
}

/// J_l(ω): exp(ω + δ) ≈ exp(J_l δ) exp(ω).
inline Matrix3<double> left_jacobian(const Vector3<double>& omega) {
  const JacobianFactors<double> f(omega.squaredNorm());
  const Matrix3<double> W = hat<double>(omega);
  return Matrix3<double>::Identity() + f.b * W + f.c * W * W;
}
/// J_r(ω): exp(ω + δ) ≈ exp(ω) exp(J_r δ). J_r(ω) = J_l(−ω) = J_l(ω)ᵀ.
inline Matrix3<double> right_jacobian(const Vector3<double>& omega) {
  return left_jacobian(-omega);
}
inline Matrix3<double> inverse_left_jacobian(const Vector3<double>& omega) {
  const double d = inverse_jacobian_factor<double>(omega.squaredNorm());
  const Matrix3<double> W = hat<double>(omega);
  return Matrix3<double>::Identity() - 0.5 * W + d * W * W;
}
/// J_r⁻¹(ω): log(exp(ω) exp(δ)) ≈ ω + J_r⁻¹ δ.
inline Matrix3<double> inverse_right_jacobian(const Vector3<double>& omega) {
  return inverse_left_jacobian(-omega);
}

}  // namespace cairn::so3
