// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam2d {

/// The position of a pose known to be z = (x y [m]), as from GNSS: error = t − z, along the axes of
/// the world. The heading is free, so that it places no pose.
struct Position {
  static constexpr std::string_view kTag = "EDGE_PRIOR_SE2_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2>;

  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& x, const Measured<S, 2>& z) noexcept {
    return {x[0] - z[0], x[1] - z[1]};
  }
  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 3>& x, const Vector<S, 2>& z,
                               Eigen::Matrix<S, 2, 3>& J) noexcept {
    const so2::Rotation<S> R(x[2]);
    J << R.c, -R.s, S(0), R.s, R.c, S(0);
    return {x[0] - z[0], x[1] - z[1]};
  }

  static std::string normalize(Vector<double, 2>& z) { return PointXY::normalize(z); }
};

}  // namespace cairn::slam2d
