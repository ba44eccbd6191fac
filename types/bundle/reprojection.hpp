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
/// what other programs minimise on this data, and chi2 can be compared; `outside` says so.
///
/// The polynomial holds for what a lens shows. Beyond ‖p‖ = 2, twice 63° wide, it fades out, and is
/// gone at 2.8: nearer to the plane of the camera a distortion of 1e-8 would hide any error.
/// In that plane a point has no image. From 1e-4 of its distance from the axis on 1/P_z goes on as
/// its tangent there, so that the error is large, but a number, whose Jacobian leads out.
struct Reprojection {
  static constexpr std::string_view kTag = "EDGE_PROJECT_BAL";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Camera, PointXYZ>;

  /// The least |P_z| as a share of |P_x| + |P_y|: any image that matters is nearer to the middle.
  static constexpr double kLeastDepth = 1e-4;
  /// A point as near as this is in the very centre of the camera, and seen in no direction.
  static constexpr double kCentre = 1e-30;
  /// ‖p‖² up to which the distortion holds, and from which on there is none.
  static constexpr double kField = 4.0, kBeyond = 2.0 * kField;

  /// Where a point has no image: too near to the plane of the camera, or in its centre.
  template <class S>
  static bool in_plane(const Vector<S, 3>& P) {
    using std::abs;
    return abs(P[2]) < (abs(P[0]) + abs(P[1])) * kLeastDepth + kCentre;
  }

  /// −1 / P_z; in the plane of the camera, on the tangent of that, and 0 in its centre.
  template <class S>
  static S inverse_depth(const Vector<S, 3>& P, bool is_in_plane) {
    using std::abs;
    if (!is_in_plane) [[likely]]
      return -1.0 / P[2];
    const S least = (abs(P[0]) + abs(P[1])) * kLeastDepth;
    if (least < kCentre) return S(0.0);
    const S magnitude = (2.0 - abs(P[2]) / least) / least;
    return P[2] > 0.0 ? -magnitude : magnitude;
  }

  /// s(n) with ds/dn, and the share w(n) that the polynomial has in it.
  template <class S>
  struct Distortion {
    S s, slope, share = S(1.0);

    Distortion(const S& n, const S& k1, const S& k2)
        : s(1.0 + n * (k1 + n * k2)), slope(k1 + 2.0 * n * k2) {
      if (n < kField) [[likely]]
        return;
      if (n < kBeyond) {
        const S t = (kBeyond - n) / (kBeyond - kField), excess = s - 1.0;
        share = t * t * (3.0 - 2.0 * t);
        slope = share * slope - 6.0 * t * (1.0 - t) / (kBeyond - kField) * excess;
        s = 1.0 + share * excess;
      } else {
        s = S(1.0);
        share = slope = S(0.0);
      }
    }
  };

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 10>& camera, const Vector<S, 3>& point,
                               const Measured<S, 2>& z) noexcept {
    const Vector<S, 7> pose = Camera::pose<S>(camera);
    const Vector<S, 3> apart = point - Se3::translation<S>(pose);
    const Vector<S, 3> P = so3::rotate_back<S>(Se3::quaternion<S>(pose), apart);
    const S inverse = inverse_depth<S>(P, in_plane<S>(P));
    const S x = P[0] * inverse, y = P[1] * inverse;
    const Distortion<S> lens(x * x + y * y, camera[1], camera[2]);
    const S scale = camera[0] * lens.s;
    return {scale * x - z[0], scale * y - z[1]};
  }

  /// With d = −1/P_z, n = ‖p‖² and s = 1 + k1 n + k2 n²: d error/dp = f (s I + 2 ds/dn p pᵀ),
  /// dp/dP = d [I | p], and moving the camera by (v, ω) moves P by −v + [P]ₓ ω.
  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 10>& camera, const Vector<S, 3>& point,
                               const Vector<S, 2>& z, Eigen::Matrix<S, 2, 9>& J_camera,
                               Eigen::Matrix<S, 2, 3>& J_point) noexcept {
    const Vector<S, 7> pose = Camera::pose<S>(camera);
    const so3::Matrix3<S> R = so3::matrix<S>(Se3::quaternion<S>(pose));  // from camera to world
    const Vector<S, 3> apart = point - Se3::translation<S>(pose);
    const Vector<S, 3> P = so3::times<S>(so3::Matrix3<S>(R.transpose()), apart);
    const bool is_in_plane = in_plane<S>(P);
    const S d = inverse_depth<S>(P, is_in_plane);
    const S x = P[0] * d, y = P[1] * d;
    const S f = camera[0];
    const S n = x * x + y * y;
    const Distortion<S> lens(n, camera[1], camera[2]);
    const S s = lens.s;

    const S slope = 2.0 * lens.slope;
    const S along = f * d * (s + slope * n);  // d error / d P_z = along · p
    Eigen::Matrix<S, 2, 3> D;                 // d error / dP
    D << f * d * (s + slope * x * x), f * d * slope * x * y, along * x,  //
        f * d * slope * x * y, f * d * (s + slope * y * y), along * y;
    if (is_in_plane) [[unlikely]]
      D = in_plane_jacobian<S>(P, f, d);
    for (int row = 0; row < 2; ++row) {
      for (int c = 0; c < 3; ++c)  // D Rᵀ
        J_point(row, c) = D(row, 0) * R(c, 0) + D(row, 1) * R(c, 1) + D(row, 2) * R(c, 2);
    }

    const S fn = f * n * lens.share, fnn = fn * n;
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

  /// d error / dP in the plane of the camera, where d = ±(2 − |P_z|/l)/l, l = 1e-4 (|P_x| + |P_y|),
  /// and there is no distortion.
  template <class S>
  static Eigen::Matrix<S, 2, 3> in_plane_jacobian(const Vector<S, 3>& P, const S& f, const S& d) {
    using std::abs;
    Eigen::Matrix<S, 2, 3> D = Eigen::Matrix<S, 2, 3>::Zero();
    const S l = (abs(P[0]) + abs(P[1])) * kLeastDepth;
    if (l < kCentre) return D;
    const S z = abs(P[2]), side = P[2] > 0.0 ? S(-1.0) : S(1.0);
    const S by_l = side * 2.0 * (z / l - 1.0) / (l * l);
    const S dd[3] = {by_l * kLeastDepth * (P[0] < 0.0 ? S(-1.0) : S(1.0)),
                     by_l * kLeastDepth * (P[1] < 0.0 ? S(-1.0) : S(1.0)), 1.0 / (l * l)};
    for (int row = 0; row < 2; ++row) {
      for (int c = 0; c < 3; ++c) D(row, c) = f * P[row] * dd[c];
      D(row, row) = D(row, row) + f * d;
    }
    return D;
  }

  // As a `Domain`.
  static std::string outside(const double* const* x) {
    const Vector<double, 3> P = seen(x);
    if (in_plane<double>(P)) return "the point is in the plane of the camera, and has no image";
    return P[2] > 0.0 ? "the point is behind the camera, which cannot see it" : "";
  }
  static double reach(const double* const* x) {
    const Vector<double, 3> P = seen(x);
    return P[2] < 0.0 && !in_plane<double>(P) ? P.norm() : -P.norm();
  }
  /// The point on the ray of its image, as without distortion.
  static bool place(int target, const double* const* x, const double* z, double reach,
                    double* out) {
    const Vector<double, 10> camera = Eigen::Map<const Vector<double, 10>>(x[0]);
    const Vector<double, 3> ray(z[0] / camera[0], z[1] / camera[0], -1.0);
    const Vector<double, 3> point =
        Camera::position(camera) + Camera::rotation(camera) * (reach / ray.norm() * ray);
    if (target != 1 || !point.allFinite()) return false;
    Eigen::Map<Vector<double, 3>>{out} = point;
    return true;
  }
  /// The point in the frame of the camera.
  static Vector<double, 3> seen(const double* const* x) {
    const Vector<double, 7> pose = Camera::pose<double>(Eigen::Map<const Vector<double, 10>>(x[0]));
    const Vector<double, 3> apart =
        Eigen::Map<const Vector<double, 3>>(x[1]) - Se3::translation<double>(pose);
    return so3::rotate_back<double>(Se3::quaternion<double>(pose), apart);
  }

  static std::string normalize(Vector<double, 2>& z) {
    return z.allFinite() ? "" : "a number is not finite";
  }
};

}  // namespace cairn::bundle
