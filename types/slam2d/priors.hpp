// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam2d {

/// A pose known to be z = (x y [m], theta [rad]): error = (translation, wrapped angle) of z⁻¹ x.
struct PosePrior {
  static constexpr std::string_view kTag = "EDGE_PRIOR_SE2";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& x, const Measured<S, 3>& z) noexcept {
    const so2::Rotation<ValueOf<S>> R_z(z[2]);
    const S dx = x[0] - z[0], dy = x[1] - z[1];
    return {dx * R_z.c + dy * R_z.s, dy * R_z.c - dx * R_z.s, wrap_angle<S>(x[2] - z[2])};
  }

  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 3>& x, const Vector<S, 3>& z,
                               Eigen::Matrix<S, 3, 3>& J) noexcept {
    const Vector<S, 3> e = residual<S>(x, z);
    const so2::Rotation<S> R_e(e[2]);
    J << R_e.c, -R_e.s, S(0), R_e.s, R_e.c, S(0), S(0), S(0), S(1);
    return e;
  }

  static std::string normalize(Vector<double, 3>& z) { return Se2::normalize(z); }
  static bool propagate(int, const double* const*, const double* z, double* out) {
    std::copy_n(z, 3, out);
    return true;
  }
};

/// A landmark known to be at z = (x y [m]): error = l − z.
struct LandmarkPrior {
  static constexpr std::string_view kTag = "EDGE_PRIOR_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<PointXY>;

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& x, const Measured<S, 2>& z) noexcept {
    return {x[0] - z[0], x[1] - z[1]};
  }
  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 2>& x, const Vector<S, 2>& z,
                               Eigen::Matrix<S, 2, 2>& J) noexcept {
    J << S(1), S(0), S(0), S(1);
    return x - z;
  }

  static std::string normalize(Vector<double, 2>& z) { return PointXY::normalize(z); }
  static bool propagate(int, const double* const*, const double* z, double* out) {
    std::copy_n(z, 2, out);
    return true;
  }
};

}  // namespace cairn::slam2d
