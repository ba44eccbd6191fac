// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/lie/se3.hpp"
#include "cairn/types/define_variable.hpp"

namespace cairn::bundle {

/// A camera of the BAL data sets (Agarwal, Snavely, Seitz, Szeliski, "Bundle adjustment in the
/// large", ECCV 2010): what it is, then where it is.
///
/// Stored are the focal length f [px], the radial distortion k1 k2 and the pose of the camera in
/// the world, as of every pose here: x y z and the unit quaternion qx qy qz qw. The camera looks
/// along its −z axis. BAL's own R and T, with P = R X + T, are the inverse of that pose; its
/// readers and writers convert. Tangent: f k1 k2 as they are, then the pose's translation and
/// rotation; retract adds the former and moves the pose by the exponential of SE(3).
///
/// Not a group: no motion of the world changes f, k1 and k2, so a camera is more than a pose (see
/// `Gauge`).
struct Camera {
  static constexpr std::string_view kTag = "VERTEX_CAMERA_BAL";
  static constexpr int kIntrinsics = 3;
  static constexpr int kAmbient = kIntrinsics + Se3::kAmbient;
  static constexpr int kTangent = kIntrinsics + Se3::kTangent;
  static constexpr int kDimension = 3;
  static constexpr bool kOriented = true;

  template <class S>
  static Vector<S, 7> pose(const Vector<S, 10>& x) {
    Vector<S, 7> T_world_camera;
    for (int k = 0; k < 7; ++k) T_world_camera[k] = x[kIntrinsics + k];
    return T_world_camera;
  }

  /// At the origin with a focal length of one and no distortion.
  static Vector<double, 10> identity() {
    Vector<double, 10> x;
    x << 1.0, 0.0, 0.0, Se3::identity();
    return x;
  }

  template <class S>
  static Vector<S, 10> retract(const Vector<S, 10>& x, const Vector<S, 9>& delta) {
    Vector<S, 6> motion;
    for (int k = 0; k < 6; ++k) motion[k] = delta[kIntrinsics + k];
    const Vector<S, 7> moved = Se3::retract<S>(pose<S>(x), motion);
    Vector<S, 10> out;
    for (int k = 0; k < kIntrinsics; ++k) out[k] = x[k] + delta[k];
    for (int k = 0; k < 7; ++k) out[kIntrinsics + k] = moved[k];
    return out;
  }
  template <class S>
  static Vector<S, 9> local(const Vector<S, 10>& x, const Vector<S, 10>& y) {
    const Vector<S, 6> motion = Se3::local<S>(pose<S>(x), pose<S>(y));
    Vector<S, 9> delta;
    for (int k = 0; k < kIntrinsics; ++k) delta[k] = y[k] - x[k];
    for (int k = 0; k < 6; ++k) delta[kIntrinsics + k] = motion[k];
    return delta;
  }

  static std::string normalize(Vector<double, 10>& x) {
    if (!x.allFinite()) return "a number is not finite";
    if (x[0] == 0.0) return "the focal length is zero";
    Vector<double, 7> T_world_camera = pose<double>(x);
    std::string problem = Se3::normalize(T_world_camera);
    x.tail<7>() = T_world_camera;
    return problem;
  }

  static Eigen::Matrix3d rotation(const Vector<double, 10>& x) {
    return Se3::rotation(pose<double>(x));
  }
  static Vector<double, 3> position(const Vector<double, 10>& x) { return x.segment<3>(3); }
  /// A placement does not determine f, k1 and k2: they are those of `identity`.
  static Vector<double, 10> from_placement(const Eigen::Matrix3d& R, const Vector<double, 3>& t) {
    Vector<double, 10> x = identity();
    x.tail<7>() = Se3::from_placement(R, t);
    return x;
  }
};

}  // namespace cairn::bundle
