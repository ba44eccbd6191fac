// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <type_traits>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/lie/so3.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/group_value.hpp"
#include "cairn/typed/point.hpp"

namespace cairn {

/// Rotations of space, stored as a unit quaternion qx qy qz qw; the tangent vector is the rotation
/// vector [rad].
struct So3 {
  static constexpr int kAmbient = 4, kTangent = 3;

  static Vector<double, 4> identity() { return Vector<double, 4>::Unit(3); }
  template <class S>
  static Vector<S, 4> compose(const Vector<S, 4>& a, const Vector<S, 4>& b) {
    return so3::multiply<S>(a, b);
  }
  template <class S>
  static Vector<S, 4> inverse(const Vector<S, 4>& a) {
    return so3::conjugate<S>(a);
  }
  /// a⁻¹ b
  template <class S>
  static Vector<S, 4> between(const Vector<S, 4>& a, const Vector<S, 4>& b) {
    return so3::multiply<S>(so3::conjugate<S>(a), b);
  }
  static Eigen::Matrix3d adjoint(const Vector<double, 4>& a) { return so3::matrix<double>(a); }
  template <class S>
  static Vector<S, 4> exp(const Vector<S, 3>& delta) {
    return so3::exp<S>(delta);
  }
  template <class S>
  static Vector<S, 3> log(const Vector<S, 4>& a) {
    return so3::log<S>(a);
  }
  template <class S>
  static Vector<S, 4> retract(const Vector<S, 4>& x, const Vector<S, 3>& delta) {
    Vector<S, 4> moved = compose<S>(x, exp<S>(delta));
    so3::renormalize<S>(moved);
    return moved;
  }
  template <class S>
  static Vector<S, 3> local(const Vector<S, 4>& x, const Vector<S, 4>& y) {
    return log<S>(between<S>(x, y));
  }
};

/// A rotation of space as a value: a unit quaternion. q and −q are the same rotation.
template <class S>
class BasicRot3 : public GroupValue<BasicRot3<S>, So3, S> {
  using Base = GroupValue<BasicRot3<S>, So3, S>;

 public:
  using typename Base::State;
  template <class T>
  using Over = BasicRot3<T>;
  static constexpr const char* kName = "Rot3";

  BasicRot3() : Base(So3::identity().template cast<S>()) {}
  /// A state as it is stored: qx qy qz qw.
  BasicRot3(const State& state) : Base(state) {}  // NOLINT(google-explicit-constructor)
  /// From Eigen's quaternion (whose constructor takes w first), normalized. Throws `Error` (input)
  /// for one that is zero or not finite.
  explicit BasicRot3(const Eigen::Quaterniond& q) requires std::is_same_v<S, double>
      : Base(State(q.coeffs())) {
    const double norm = this->x_.stableNorm();
    if (!(norm > 1e-9 && std::isfinite(norm))) {
      throw Error(ErrorCode::input, "a rotation's quaternion is zero or not finite");
    }
    this->x_ /= q.w() < 0.0 ? -norm : norm;
  }
  /// The rotation nearest to a 3 × 3 matrix that is one but for rounding.
  explicit BasicRot3(const Eigen::Matrix3d& R) requires std::is_same_v<S, double>
      : Base(so3::from_matrix(R)) {}

  /// R_z(yaw) R_y(pitch) R_x(roll), angles [rad].
  static BasicRot3 roll_pitch_yaw(double roll, double pitch,
                                  double yaw) requires std::is_same_v<S, double> {
    return State(so3::from_roll_pitch_yaw(roll, pitch, yaw));
  }
  /// About the vertical axis z, by an angle [rad].
  static BasicRot3 yaw(double angle) requires std::is_same_v<S, double> {
    return roll_pitch_yaw(0.0, 0.0, angle);
  }

  /// (roll, pitch, yaw) [rad], pitch within [−π/2, π/2].
  Eigen::Vector3d roll_pitch_yaw() const requires std::is_same_v<S, double> {
    return so3::to_roll_pitch_yaw(this->x_);
  }
  Eigen::Quaterniond quaternion() const requires std::is_same_v<S, double> {
    return Eigen::Quaterniond(this->x_[3], this->x_[0], this->x_[1], this->x_[2]);
  }
  Eigen::Matrix<S, 3, 3> matrix() const { return so3::matrix<S>(this->x_); }

  /// R p: from the rotated frame to the fixed one.
  friend BasicPoint3<S> operator*(const BasicRot3& R, const BasicPoint3<S>& p) {
    return so3::rotate<S>(R.x_, p);
  }
  /// Rᵀ p: from the fixed frame to the rotated one.
  BasicPoint3<S> unrotate(const BasicPoint3<S>& p) const {
    return so3::rotate_back<S>(this->x_, p);
  }

  /// "Rot3(roll, pitch, yaw)" [rad].
  friend std::string to_string(const BasicRot3& R) requires std::is_same_v<S, double> {
    const Eigen::Vector3d angles = R.roll_pitch_yaw();
    return detail::value_text(kName, {angles[0], angles[1], angles[2]});
  }

 private:
  friend Base;
  static void renormalize(State& q) { so3::renormalize<S>(q); }
};

/// A rotation of space.
using Rot3 = BasicRot3<double>;

}  // namespace cairn
