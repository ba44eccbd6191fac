// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"
#include "metrics.hpp"

namespace cairn::slam3d {

/// The orientation of a pose known to be z = (qw qx qy qz), as from an attitude filter: error = the
/// rotational part of Metric(z⁻¹ x). The order is that of the files with this tag.
template <class Metric>
struct Orientation {
  static constexpr std::string_view kTag = "EDGE_SE3_PRIORQUAT";
  static constexpr int kResidual = 3, kMeasurement = 4;
  static constexpr std::string_view kMetric = Metric::kName;
  using Variables = std::tuple<Se3>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 7>& x, const Measured<S, 4>& z) noexcept {
    const Vector<S, 4> known = z.template cast<S>();
    const Vector<S, 6> e = Metric::template error<S>(turned<S>(x, known));
    return {e[3], e[4], e[5]};
  }
  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 7>& x, const Vector<S, 4>& z,
                               Eigen::Matrix<S, 3, 6>& J) noexcept {
    ErrorDerivative<S> D;
    const Vector<S, 6> e = Metric::template derivative<S>(turned<S>(x, z), D);
    for (int k = 0; k < 9; ++k) {
      J.data()[k] = 0.0;
      J.data()[9 + k] = D.rotation.data()[k];
    }
    return {e[3], e[4], e[5]};
  }

  static std::string normalize(Vector<double, 4>& z) {
    Vector<double, 7> pose;
    pose << 0.0, 0.0, 0.0, z[1], z[2], z[3], z[0];
    std::string problem = Se3::normalize(pose);
    z << pose[6], pose[3], pose[4], pose[5];
    return problem;
  }

 private:
  /// z⁻¹ x without its translation, which is not measured.
  template <class S>
  static Vector<S, 7> turned(const Vector<S, 7>& x, const Vector<S, 4>& z) {
    const Vector<S, 4> back(-z[1], -z[2], -z[3], z[0]);
    const Vector<S, 4> q = so3::multiply<S>(back, Se3::quaternion<S>(x));
    return Se3::join<S>(Vector<S, 3>(S(0.0), S(0.0), S(0.0)), q);
  }
};

}  // namespace cairn::slam3d
