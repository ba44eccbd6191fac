// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <type_traits>

#include <Eigen/Core>

#include "cairn/lie/se2.hpp"
#include "cairn/typed/group_value.hpp"
#include "cairn/typed/point.hpp"
#include "cairn/typed/rot2.hpp"

namespace cairn {

/// A pose in the plane as a value: where a body is in the world, x y [m], theta [rad]; or where one
/// body is as seen from another. The tangent vector is (forward [m], left [m], turn [rad]).
///
///     Pose2 b = a * Pose2(1.0, 0.0, 0.0);    // a metre ahead of a
///     Pose2 seen = a.between(b);             // b in the frame of a: a⁻¹ b
///     Point2 world = a * Point2(2.0, 1.0);   // a point of the body's frame
template <class S>
class BasicPose2 : public GroupValue<BasicPose2<S>, Se2, S> {
  using Base = GroupValue<BasicPose2<S>, Se2, S>;

 public:
  using typename Base::State;
  template <class T>
  using Over = BasicPose2<T>;
  static constexpr const char* kName = "Pose2";

  BasicPose2() : Base(Se2::identity().template cast<S>()) {}
  /// x y [m], theta [rad], which is wrapped to [−π, π].
  BasicPose2(const S& x, const S& y, const S& theta) : Base(State(x, y, wrap_angle<S>(theta))) {}
  BasicPose2(const BasicRot2<S>& rotation, const BasicPoint2<S>& translation)
      : Base(State(translation[0], translation[1], rotation.angle())) {}
  /// A state as it is stored.
  BasicPose2(const State& state) : Base(state) {}  // NOLINT(google-explicit-constructor)

  const S& x() const { return this->x_[0]; }
  const S& y() const { return this->x_[1]; }
  const S& theta() const { return this->x_[2]; }
  BasicPoint2<S> translation() const { return {x(), y()}; }
  BasicRot2<S> rotation() const { return BasicRot2<S>(Vector<S, 1>(theta())); }
  /// Homogeneous: [R t; 0 1].
  Eigen::Matrix<S, 3, 3> matrix() const {
    Eigen::Matrix<S, 3, 3> T = Eigen::Matrix<S, 3, 3>::Identity();
    T.template topLeftCorner<2, 2>() = rotation().matrix();
    T.template topRightCorner<2, 1>() = translation();
    return T;
  }

  /// R p + t: a point of the body's frame, in the world.
  BasicPoint2<S> transform_from(const BasicPoint2<S>& p) const {
    const Vector<S, 2> turned = so2::Rotation<S>(theta()) * p;
    return {x() + turned[0], y() + turned[1]};
  }
  /// Rᵀ (p − t): a point of the world, in the body's frame.
  BasicPoint2<S> transform_to(const BasicPoint2<S>& p) const {
    return so2::Rotation<S>(theta()).inverse_times(Vector<S, 2>(p[0] - x(), p[1] - y()));
  }
  friend BasicPoint2<S> operator*(const BasicPose2& T, const BasicPoint2<S>& p) {
    return T.transform_from(p);
  }

  /// "Pose2(x, y, theta)" [m, rad].
  friend std::string to_string(const BasicPose2& pose) requires std::is_same_v<S, double> {
    return detail::value_text(kName, {pose.x(), pose.y(), pose.theta()});
  }

 private:
  friend Base;
  static void renormalize(State&) {}
};

/// A pose in the plane: x y [m], theta [rad]; VERTEX_SE2 in files.
using Pose2 = BasicPose2<double>;

}  // namespace cairn
