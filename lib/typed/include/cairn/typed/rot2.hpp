// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <type_traits>

#include "cairn/lie/so2.hpp"
#include "cairn/typed/group_value.hpp"
#include "cairn/typed/point.hpp"

namespace cairn {

/// Rotations of the plane, stored as an angle [rad]; the tangent vector is the angle.
struct So2 {
  static constexpr int kAmbient = 1, kTangent = 1;

  static Vector<double, 1> identity() { return Vector<double, 1>::Zero(); }
  template <class S>
  static Vector<S, 1> compose(const Vector<S, 1>& a, const Vector<S, 1>& b) {
    return Vector<S, 1>(wrap_angle<S>(a[0] + b[0]));
  }
  template <class S>
  static Vector<S, 1> inverse(const Vector<S, 1>& a) {
    return Vector<S, 1>(-a[0]);
  }
  /// a⁻¹ b
  template <class S>
  static Vector<S, 1> between(const Vector<S, 1>& a, const Vector<S, 1>& b) {
    return Vector<S, 1>(wrap_angle<S>(b[0] - a[0]));
  }
  static Eigen::Matrix<double, 1, 1> adjoint(const Vector<double, 1>&) {
    return Eigen::Matrix<double, 1, 1>::Identity();
  }
  template <class S>
  static Vector<S, 1> exp(const Vector<S, 1>& delta) {
    return Vector<S, 1>(wrap_angle<S>(delta[0]));
  }
  template <class S>
  static Vector<S, 1> log(const Vector<S, 1>& a) {
    return Vector<S, 1>(wrap_angle<S>(a[0]));
  }
  template <class S>
  static Vector<S, 1> retract(const Vector<S, 1>& x, const Vector<S, 1>& delta) {
    return compose<S>(x, delta);
  }
  template <class S>
  static Vector<S, 1> local(const Vector<S, 1>& x, const Vector<S, 1>& y) {
    return between<S>(x, y);
  }
};

/// A rotation of the plane as a value: an angle [rad] within [−π, π], counted anticlockwise.
template <class S>
class BasicRot2 : public GroupValue<BasicRot2<S>, So2, S> {
  using Base = GroupValue<BasicRot2<S>, So2, S>;

 public:
  using typename Base::State;
  template <class T>
  using Over = BasicRot2<T>;
  static constexpr const char* kName = "Rot2";

  BasicRot2() : Base(So2::identity().template cast<S>()) {}
  /// By its angle [rad], which is wrapped.
  explicit BasicRot2(const S& angle) : Base(State(wrap_angle<S>(angle))) {}
  /// A state as it is stored.
  BasicRot2(const State& state) : Base(state) {}  // NOLINT(google-explicit-constructor)

  const S& angle() const { return this->x_[0]; }
  Eigen::Matrix<S, 2, 2> matrix() const { return so2::Rotation<S>(angle()).matrix(); }

  /// R p: from the rotated frame to the fixed one.
  friend BasicPoint2<S> operator*(const BasicRot2& R, const BasicPoint2<S>& p) {
    return so2::Rotation<S>(R.angle()) * p;
  }
  /// Rᵀ p: from the fixed frame to the rotated one.
  BasicPoint2<S> unrotate(const BasicPoint2<S>& p) const {
    return so2::Rotation<S>(angle()).inverse_times(p);
  }

  /// "Rot2(1.5708)": the angle [rad].
  friend std::string to_string(const BasicRot2& R) requires std::is_same_v<S, double> {
    return detail::value_text(kName, {R.angle()});
  }

 private:
  friend Base;
  static void renormalize(State&) {}
};

/// A rotation of the plane [rad].
using Rot2 = BasicRot2<double>;

}  // namespace cairn
