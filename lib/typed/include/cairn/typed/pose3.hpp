// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <type_traits>

#include <Eigen/Core>

#include "cairn/lie/se3.hpp"
#include "cairn/typed/group_value.hpp"
#include "cairn/typed/point.hpp"
#include "cairn/typed/rot3.hpp"

namespace cairn {

/// A pose in space as a value: where a body is in the world, or as seen from another. Stored as
/// x y z [m] and a unit quaternion qx qy qz qw; the tangent vector is translation [m], then
/// rotation vector [rad], both in the frame of the body.
///
///     Pose3 b = a * Pose3(Rot3::yaw(0.1), Point3(1.0, 0.0, 0.0));
///     Pose3 seen = a.between(b);                  // b in the frame of a: a⁻¹ b
///     Point3 world = a * Point3(2.0, 1.0, 0.0);   // a point of the body's frame
template <class S>
class BasicPose3 : public GroupValue<BasicPose3<S>, Se3, S> {
  using Base = GroupValue<BasicPose3<S>, Se3, S>;

 public:
  using typename Base::State;
  template <class T>
  using Over = BasicPose3<T>;
  static constexpr const char* kName = "Pose3";

  BasicPose3() : Base(Se3::identity().template cast<S>()) {}
  BasicPose3(const BasicRot3<S>& rotation, const BasicPoint3<S>& translation)
      : Base(Se3::join<S>(translation, rotation.state())) {}
  /// A state as it is stored: x y z qx qy qz qw.
  BasicPose3(const State& state) : Base(state) {}  // NOLINT(google-explicit-constructor)
  /// From a homogeneous matrix [R t; 0 1].
  explicit BasicPose3(const Eigen::Matrix4d& T) requires std::is_same_v<S, double>
      : BasicPose3(BasicRot3<S>(Eigen::Matrix3d(T.topLeftCorner<3, 3>())),
                   Point3(T.topRightCorner<3, 1>())) {}

  const S& x() const { return this->x_[0]; }
  const S& y() const { return this->x_[1]; }
  const S& z() const { return this->x_[2]; }
  BasicPoint3<S> translation() const { return Se3::translation<S>(this->x_); }
  BasicRot3<S> rotation() const { return Se3::quaternion<S>(this->x_); }
  /// Homogeneous: [R t; 0 1].
  Eigen::Matrix<S, 4, 4> matrix() const {
    Eigen::Matrix<S, 4, 4> T = Eigen::Matrix<S, 4, 4>::Identity();
    T.template topLeftCorner<3, 3>() = rotation().matrix();
    T.template topRightCorner<3, 1>() = translation();
    return T;
  }

  /// R p + t: a point of the body's frame, in the world.
  BasicPoint3<S> transform_from(const BasicPoint3<S>& p) const {
    return translation() + so3::rotate<S>(rotation().state(), p);
  }
  /// Rᵀ (p − t): a point of the world, in the body's frame.
  BasicPoint3<S> transform_to(const BasicPoint3<S>& p) const {
    return so3::rotate_back<S>(rotation().state(), Vector<S, 3>(p - translation()));
  }
  friend BasicPoint3<S> operator*(const BasicPose3& T, const BasicPoint3<S>& p) {
    return T.transform_from(p);
  }

  /// "Pose3(x, y, z; roll, pitch, yaw)" [m, rad].
  friend std::string to_string(const BasicPose3& pose) requires std::is_same_v<S, double> {
    const Eigen::Vector3d angles = pose.rotation().roll_pitch_yaw();
    std::string text = detail::value_text(kName, {pose.x(), pose.y(), pose.z()});
    text.back() = ';';
    return text + detail::value_text(" ", {angles[0], angles[1], angles[2]}).erase(1, 1);
  }

 private:
  friend Base;
  static void renormalize(State& x) {
    Vector<S, 4> q = Se3::quaternion<S>(x);
    so3::renormalize<S>(q);
    x = Se3::join<S>(Se3::translation<S>(x), q);
  }
};

/// A pose in space: x y z [m] and a rotation; VERTEX_SE3:QUAT in files.
using Pose3 = BasicPose3<double>;

}  // namespace cairn
