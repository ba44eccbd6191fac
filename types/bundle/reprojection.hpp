// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <tuple>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"
#include "camera.hpp"

namespace cairn::bundle {

/// Point X seen by a camera at z = (u v [px]), from the middle of the image, u to the right and v
/// up. With P = Rᵀ (X − t) the point in the frame of the camera, and p = −(P_x, P_y) / P_z:
///
///     error = f (1 + k1 ‖p‖² + k2 ‖p‖⁴) p − z
///
/// A point behind the camera (P_z > 0) has the image that this formula gives, mirrored: that is
/// what other programs minimise on this data, and chi2 can be compared. Where the point lies in the
/// plane of the camera it has no image; its direction is then taken to be a hair in front of or
/// behind that plane, so that the error is large but a number, and no step goes there.
struct Reprojection {
  static constexpr std::string_view kTag = "EDGE_PROJECT_BAL";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Camera, PointXYZ>;

  /// The least |P_z| as a share of |P_x| + |P_y|: any image that matters is nearer to the middle.
  static constexpr double kLeastDepth = 1e-12;
  /// A point as near as this is in the very centre of the camera, and seen in no direction.
  static constexpr double kCentre = 1e-30;

  /// −1 / P_z, and 0 for a point in the centre.
  template <class S>
  static S inverse_depth(const Vector<S, 3>& P) {
    using lanes::if_less;
    using std::abs;
    const S z = abs(P[2]), least = (abs(P[0]) + abs(P[1])) * kLeastDepth;
    const S depth = if_less(least, z, z, least);
    return if_less(S(kCentre), depth, if_less(S(0.0), P[2], -1.0, 1.0) / depth, S(0.0));
  }

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 10>& camera, const Vector<S, 3>& point,
                               const Measured<S, 2>& z) noexcept {
    const Vector<S, 7> pose = Camera::pose<S>(camera);
    const Vector<S, 3> apart = point - Se3::translation<S>(pose);
    const Vector<S, 3> P = so3::rotate_back<S>(Se3::quaternion<S>(pose), apart);
    const S inverse = inverse_depth<S>(P);
    const S x = P[0] * inverse, y = P[1] * inverse;
    const S square = x * x + y * y;
    const S scale = camera[0] * (1.0 + square * (camera[1] + square * camera[2]));
    return {scale * x - z[0], scale * y - z[1]};
  }

  /// With d = −1/P_z, n = ‖p‖² and s = 1 + k1 n + k2 n²: d error/dp = f (s I + 2 (k1 + 2 k2 n) p
  /// pᵀ), dp/dP = d [I | p], and moving the camera by (v, ω) moves P by −v + [P]ₓ ω.
  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 10>& camera, const Vector<S, 3>& point,
                               const Vector<S, 2>& z, Eigen::Matrix<S, 2, 9>& J_camera,
                               Eigen::Matrix<S, 2, 3>& J_point) noexcept {
    const Vector<S, 7> pose = Camera::pose<S>(camera);
    const so3::Matrix3<S> R = so3::matrix<S>(Se3::quaternion<S>(pose));  // from camera to world
    const Vector<S, 3> apart = point - Se3::translation<S>(pose);
    const Vector<S, 3> P = so3::times<S>(so3::Matrix3<S>(R.transpose()), apart);
    const S d = inverse_depth<S>(P);
    const S x = P[0] * d, y = P[1] * d;
    const S f = camera[0], k1 = camera[1], k2 = camera[2];
    const S n = x * x + y * y;
    const S s = 1.0 + n * (k1 + n * k2);

    const S slope = 2.0 * (k1 + 2.0 * n * k2);
    const S along = f * d * (s + slope * n);  // d error / d P_z = along · p
    Eigen::Matrix<S, 2, 3> D;                 // d error / dP
    D << f * d * (s + slope * x * x), f * d * slope * x * y, along * x,  //
        f * d * slope * x * y, f * d * (s + slope * y * y), along * y;
    for (int row = 0; row < 2; ++row) {
      for (int c = 0; c < 3; ++c)  // D Rᵀ
        J_point(row, c) = D(row, 0) * R(c, 0) + D(row, 1) * R(c, 1) + D(row, 2) * R(c, 2);
    }

    const S fn = f * n, fnn = fn * n;
    for (int row = 0; row < 2; ++row) {
      const S p = row == 0 ? x : y;
      J_camera(row, 0) = s * p;
      J_camera(row, 1) = fn * p;
      J_camera(row, 2) = fnn * p;
      J_camera(row, 3) = -D(row, 0);
      J_camera(row, 4) = -D(row, 1);
      J_camera(row, 5) = -D(row, 2);
      J_camera(row, 6) = D(row, 1) * P[2] - D(row, 2) * P[1];  // D [P]ₓ
      J_camera(row, 7) = D(row, 2) * P[0] - D(row, 0) * P[2];
      J_camera(row, 8) = D(row, 0) * P[1] - D(row, 1) * P[0];
    }
    return {f * s * x - z[0], f * s * y - z[1]};
  }

  static std::string normalize(Vector<double, 2>& z) {
    return z.allFinite() ? "" : "a number is not finite";
  }
};

}  // namespace cairn::bundle
