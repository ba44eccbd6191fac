// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <string_view>

#include "cairn/lie/so3.hpp"
#include "cairn/types/define_variable.hpp"

namespace cairn {

/// A pose in space: x y z [m] and unit quaternion qx qy qz qw; tangent: translation then rotation.
/// retract(x, δ) = x exp(δ) with the exponential of the group, and local is its inverse.
struct Se3 {
  static constexpr std::string_view kTag = "VERTEX_SE3:QUAT";
  static constexpr int kAmbient = 7, kTangent = 6;
  static constexpr int kDimension = 3;
  static constexpr bool kOriented = true;

  template <class S>
  static Vector<S, 3> translation(const Vector<S, 7>& x) {
    return {x[0], x[1], x[2]};
  }
  template <class S>
  static Vector<S, 4> quaternion(const Vector<S, 7>& x) {
    return {x[3], x[4], x[5], x[6]};
  }
  template <class S>
  static Vector<S, 7> join(const Vector<S, 3>& t, const Vector<S, 4>& q) {
    Vector<S, 7> x;
    for (int k = 0; k < 3; ++k) x[k] = t[k];
    for (int k = 0; k < 4; ++k) x[3 + k] = q[k];
    return x;
  }

  static Vector<double, 7> identity() { return Vector<double, 7>::Unit(6); }

  template <class S>
  static Vector<S, 7> compose(const Vector<S, 7>& a, const Vector<S, 7>& b) {
    const Vector<S, 4> q = quaternion<S>(a);
    const Vector<S, 3> t = translation<S>(a) + so3::rotate<S>(q, translation<S>(b));
    return join<S>(t, so3::multiply<S>(q, quaternion<S>(b)));
  }
  template <class S>
  static Vector<S, 7> inverse(const Vector<S, 7>& a) {
    const Vector<S, 4> q = quaternion<S>(a);
    const Vector<S, 3> t = -so3::rotate_back<S>(q, translation<S>(a));
    return join<S>(t, so3::conjugate<S>(q));
  }
  /// a⁻¹ b
  template <class S>
  static Vector<S, 7> between(const Vector<S, 7>& a, const Vector<S, 7>& b) {
    const Vector<S, 4> q = quaternion<S>(a);
    const Vector<S, 3> apart = translation<S>(b) - translation<S>(a);
    return join<S>(so3::rotate_back<S>(q, apart),
                   so3::multiply<S>(so3::conjugate<S>(q), quaternion<S>(b)));
  }
  static Eigen::Matrix<double, 6, 6> adjoint(const Vector<double, 7>& a) {
    const Eigen::Matrix3d R = rotation(a);
    Eigen::Matrix<double, 6, 6> Ad;
    Ad << R, so3::hat<double>(position(a)) * R, Eigen::Matrix3d::Zero(), R;
    return Ad;
  }

  template <class S>
  static Vector<S, 7> exp(const Vector<S, 6>& delta) {
    const Vector<S, 3> rho(delta[0], delta[1], delta[2]), omega(delta[3], delta[4], delta[5]);
    return join<S>(so3::left_jacobian_times<S>(omega, rho), so3::exp<S>(omega));
  }
  template <class S>
  static Vector<S, 6> log(const Vector<S, 7>& x) {
    const Vector<S, 3> omega = so3::log<S>(quaternion<S>(x));
    const Vector<S, 3> rho = so3::inverse_left_jacobian_times<S>(omega, translation<S>(x));
    Vector<S, 6> delta;
    for (int k = 0; k < 3; ++k) delta[k] = rho[k], delta[3 + k] = omega[k];
    return delta;
  }

  template <class S>
  static Vector<S, 7> retract(const Vector<S, 7>& x, const Vector<S, 6>& delta) {
    const Vector<S, 7> moved = compose<S>(x, exp<S>(delta));
    Vector<S, 4> q = quaternion<S>(moved);
    so3::renormalize<S>(q);  // or rounding would pile up over many steps
    return join<S>(translation<S>(moved), q);
  }
  template <class S>
  static Vector<S, 6> local(const Vector<S, 7>& x, const Vector<S, 7>& y) {
    return log<S>(between<S>(x, y));
  }

  /// The right Jacobian of exp at δ, wherever x is: [J_r Q; 0 J_r], J_r that of the rotation and Q
  /// as Barfoot and Furgale (2014, equation 102) have it, at −δ.
  static Eigen::Matrix<double, 6, 6> retract_jacobian(const Vector<double, 7>&,
                                                      const Vector<double, 6>& delta) {
    const Eigen::Matrix3d P = so3::hat<double>(-delta.head<3>()),
                          W = so3::hat<double>(-delta.tail<3>());
    const double square = delta.tail<3>().squaredNorm();
    const so3::JacobianFactors<double> f(square);
    double c2, c3;
    if (square < 0.1) {
      c2 = (1.0 / 24) - square * ((1.0 / 720) - square * ((1.0 / 40320) - square / 3628800));
      c3 = (1.0 / 120) - square * ((1.0 / 2520) - square * ((1.0 / 120960) - square / 9979200));
    } else {
      const double theta = std::sqrt(square);
      c2 = (0.5 - f.b) / square;
      c3 = (2.0 * theta - 3.0 * std::sin(theta) + theta * std::cos(theta)) /
           (2.0 * square * square * theta);
    }
    const Eigen::Matrix3d WP = W * P, PW = P * W, WPW = WP * W,
                          J = so3::right_jacobian(delta.tail<3>());
    Eigen::Matrix<double, 6, 6> D;
    D.topLeftCorner<3, 3>() = D.bottomRightCorner<3, 3>() = J;
    D.bottomLeftCorner<3, 3>().setZero();
    D.topRightCorner<3, 3>() = 0.5 * P + f.c * (WP + PW + WPW) +
                               c2 * (W * WP + PW * W - 3.0 * WPW) + c3 * (WPW * W + W * WPW);
    return D;
  }

  /// Unit quaternion with w ≥ 0, so that a pose has one way to be written.
  static std::string normalize(Vector<double, 7>& x) {
    if (!x.allFinite()) return "a coordinate is not finite";
    const double norm = x.tail<4>().stableNorm();
    if (norm < 1e-9) return "the quaternion is zero";
    // A few last bits off is as good as dividing again gets it; leaving it makes reading what was
    // written exact.
    if (std::abs(norm - 1.0) > 1e-15) x.tail<4>() /= norm;
    if (x[6] < 0.0) x.tail<4>() = -x.tail<4>();
    return {};
  }
  static Eigen::Matrix3d rotation(const Vector<double, 7>& x) {
    return so3::matrix<double>(quaternion<double>(x));
  }
  static Vector<double, 3> position(const Vector<double, 7>& x) { return x.head<3>(); }
  static Vector<double, 7> from_placement(const Eigen::Matrix3d& R, const Vector<double, 3>& t) {
    return join<double>(t, so3::from_matrix(R));
  }
};

}  // namespace cairn
