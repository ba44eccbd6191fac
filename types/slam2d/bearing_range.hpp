// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/domain.hpp"

namespace cairn::slam2d {

/// Landmark l seen from a pose at z = (bearing [rad], range [m]); with p = Rᵀ (l − t):
/// error = (wrapped atan2(p_y, p_x) − bearing, ‖p‖ − range).
struct BearingRange {
  static constexpr std::string_view kTag = "EDGE_BEARING_RANGE_SE2_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2, PointXY>;

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& pose, const Vector<S, 2>& landmark,
                               const Measured<S, 2>& z) noexcept {
    using std::sqrt;
    const so2::Rotation<S> R(pose[2]);
    const S dx = landmark[0] - pose[0], dy = landmark[1] - pose[1];
    const S px = R.c * dx + R.s * dy, py = R.c * dy - R.s * dx;
    return {wrap_angle<S>(so2::polar_angle<S>(py, px) - z[0]), sqrt(px * px + py * py) - z[1]};
  }

  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 3>& pose, const Vector<S, 2>& landmark,
                               const Vector<S, 2>& z, Eigen::Matrix<S, 2, 3>& J_pose,
                               Eigen::Matrix<S, 2, 2>& J_landmark) noexcept {
    using lanes::if_less;
    using std::sqrt;
    const so2::Rotation<S> R(pose[2]);
    const S dx = landmark[0] - pose[0], dy = landmark[1] - pose[1];
    const S px = R.c * dx + R.s * dy, py = R.c * dy - R.s * dx;
    const S range = sqrt(px * px + py * py);
    // A pose on top of its landmark sees no direction: no derivative, rather than an infinite one.
    const S inverse = if_less(S(0.0), range, 1.0 / range, 0.0);
    const S ux = px * inverse, uy = py * inverse;
    const S bx = -uy * inverse, by = ux * inverse;  // d bearing / dp
    J_pose << -bx, -by, if_less(S(0.0), range, -1.0, 0.0), -ux, -uy, S(0.0);
    J_landmark << bx * R.c - by * R.s, bx * R.s + by * R.c,  //
        ux * R.c - uy * R.s, ux * R.s + uy * R.c;
    return {wrap_angle<S>(so2::polar_angle<S>(py, px) - z[0]), range - z[1]};
  }

  // As a `Domain`. A start far from there is no better for being so, and initial guesses have
  // others.
  static std::string outside(const double* const* x) {
    return reach(x) > 0.0 ? "" : "the landmark is where the pose is, from where it has no bearing";
  }
  /// Two places that differ by rounding are one: a minimum of chi2 there is that of its cut alone.
  static double reach(const double* const* x) {
    constexpr double kOnePlace = 1e-8;
    const double range = std::hypot(x[1][0] - x[0][0], x[1][1] - x[0][1]);
    return range > kOnePlace * std::hypot(x[1][0], x[1][1]) ? range : -range;
  }
  static bool place(int, const double* const*, const double*, double, double*) { return false; }

  static std::string normalize(Vector<double, 2>& z) {
    if (!z.allFinite()) return "a number is not finite";
    if (z[1] < 0.0) return "the range is negative";
    z[0] = wrap_angle(z[0]);
    return {};
  }

  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    if (target != 1) return false;
    const so2::Rotation<double> direction(x[0][2] + z[0]);
    out[0] = x[0][0] + z[1] * direction.c;
    out[1] = x[0][1] + z[1] * direction.s;
    return true;
  }
};

}  // namespace cairn::slam2d
