// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam2d {

/// Relative pose z = (x y [m], theta [rad]) of pose b as seen from pose a:
/// error = (translation, wrapped angle) of z⁻¹ (a⁻¹ b), as g2o, GTSAM and Ceres' example have it.
struct RelativePose {
  static constexpr std::string_view kTag = "EDGE_SE2";
  static constexpr int kResidual = 3, kMeasurement = 3;
  static constexpr bool kRelative = true;
  using Variables = std::tuple<Se2, Se2>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Measured<S, 3>& z) noexcept {
    const so2::Rotation<S> R_a(a[2]);
    const so2::Rotation<ValueOf<S>> R_z(z[2]);
    const S dx = b[0] - a[0], dy = b[1] - a[1];
    const S px = R_a.c * dx + R_a.s * dy - z[0], py = R_a.c * dy - R_a.s * dx - z[1];
    return {px * R_z.c + py * R_z.s, py * R_z.c - px * R_z.s, wrap_angle<S>(b[2] - a[2] - z[2])};
  }

  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 3>& a, const Vector<S, 3>& b, const Vector<S, 3>& z,
                               Eigen::Matrix<S, 3, 3>& J_a, Eigen::Matrix<S, 3, 3>& J_b) noexcept {
    const so2::Rotation<S> R_a(a[2]), R_z(z[2]);
    const S dx = b[0] - a[0], dy = b[1] - a[1];
    const S px = R_a.c * dx + R_a.s * dy, py = R_a.c * dy - R_a.s * dx;  // b seen from a
    const S ex = px - z[0], ey = py - z[1];
    const S angle = wrap_angle<S>(b[2] - a[2] - z[2]);
    const so2::Rotation<S> R_e(angle);
    J_a << -R_z.c, -R_z.s, R_z.c * py - R_z.s * px,  //
        R_z.s, -R_z.c, -R_z.s * py - R_z.c * px,     //
        S(0), S(0), S(-1);
    J_b << R_e.c, -R_e.s, S(0), R_e.s, R_e.c, S(0), S(0), S(0), S(1);
    return {R_z.c * ex + R_z.s * ey, R_z.c * ey - R_z.s * ex, angle};
  }

  static std::string normalize(Vector<double, 3>& z) { return Se2::normalize(z); }

  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    using State = Vector<double, 3>;
    const Eigen::Map<const State> z_ab(z);
    Eigen::Map<State>{out} = target == 1 ? Se2::compose<double>(Eigen::Map<const State>(x[0]), z_ab)
                                         : Se2::compose<double>(Eigen::Map<const State>(x[1]),
                                                                Se2::inverse<double>(z_ab));
    return true;
  }
};

}  // namespace cairn::slam2d
