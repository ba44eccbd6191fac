// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam2d {

/// Landmark l seen from a pose at z = (x y [m]) in the frame of the pose: error = Rᵀ (l − t) − z.
struct Landmark {
  static constexpr std::string_view kTag = "EDGE_SE2_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2, PointXY>;

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& pose, const Vector<S, 2>& landmark,
                               const Measured<S, 2>& z) noexcept {
    const so2::Rotation<S> R(pose[2]);
    const S dx = landmark[0] - pose[0], dy = landmark[1] - pose[1];
    return {R.c * dx + R.s * dy - z[0], R.c * dy - R.s * dx - z[1]};
  }

  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 3>& pose, const Vector<S, 2>& landmark,
                               const Vector<S, 2>& z, Eigen::Matrix<S, 2, 3>& J_pose,
                               Eigen::Matrix<S, 2, 2>& J_landmark) noexcept {
    const so2::Rotation<S> R(pose[2]);
    const S dx = landmark[0] - pose[0], dy = landmark[1] - pose[1];
    const S px = R.c * dx + R.s * dy, py = R.c * dy - R.s * dx;
    J_pose << S(-1), S(0), py, S(0), S(-1), -px;
    J_landmark << R.c, R.s, -R.s, R.c;
    return {px - z[0], py - z[1]};
  }

  static std::string normalize(Vector<double, 2>& z) { return PointXY::normalize(z); }

  /// The landmark follows from the pose; one landmark does not determine a pose.
  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    if (target != 1) return false;
    const so2::Rotation<double> R(x[0][2]);
    out[0] = x[0][0] + R.c * z[0] - R.s * z[1];
    out[1] = x[0][1] + R.s * z[0] + R.c * z[1];
    return true;
  }
};

}  // namespace cairn::slam2d
