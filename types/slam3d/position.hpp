// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::slam3d {

/// The position of a pose known to be z = (x y z [m]), as from GNSS or an altimeter: error = t − z,
/// along the axes of the world and whatever the orientation. The orientation is free, so that it
/// places no pose.
struct Position {
  static constexpr std::string_view kTag = "EDGE_SE3_PRIORXYZ";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se3>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 7>& x, const Measured<S, 3>& z) noexcept {
    return {x[0] - z[0], x[1] - z[1], x[2] - z[2]};
  }
  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 7>& x, const Vector<S, 3>& z,
                               Eigen::Matrix<S, 3, 6>& J) noexcept {
    const so3::Matrix3<S> R = so3::matrix<S>(Se3::quaternion<S>(x));
    for (int k = 0; k < 9; ++k) {
      J.data()[k] = R.data()[k];
      J.data()[9 + k] = 0.0;
    }
    return {x[0] - z[0], x[1] - z[1], x[2] - z[2]};
  }

  static std::string normalize(Vector<double, 3>& z) { return PointXYZ::normalize(z); }
};

}  // namespace cairn::slam3d
