// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"
#include "metrics.hpp"

namespace cairn::slam3d {

/// A pose known to be z = (x y z [m], qx qy qz qw): error = Metric(z⁻¹ x).
template <class Metric>
struct PosePrior {
  static constexpr std::string_view kTag = "EDGE_PRIOR_SE3:QUAT";
  static constexpr int kResidual = 6, kMeasurement = 7;
  static constexpr std::string_view kMetric = Metric::kName;
  using Variables = std::tuple<Se3>;

  template <class S>
  static Vector<S, 6> residual(const Vector<S, 7>& x, const Measured<S, 7>& z) noexcept {
    const Vector<S, 7> known = z.template cast<S>();
    return Metric::template error<S>(Se3::between<S>(known, x));
  }
  template <class S>
  static Vector<S, 6> evaluate(const Vector<S, 7>& x, const Vector<S, 7>& z,
                               Eigen::Matrix<S, 6, 6>& J) noexcept {
    ErrorDerivative<S> D;
    const Vector<S, 6> e = Metric::template derivative<S>(Se3::between<S>(z, x), D);
    D.assemble(J);
    return e;
  }

  static std::string normalize(Vector<double, 7>& z) { return Se3::normalize(z); }
  static bool propagate(int, const double* const*, const double* z, double* out) {
    std::copy_n(z, 7, out);
    return true;
  }
};

/// A landmark known to be at z = (x y z [m]): error = l − z.
struct LandmarkPrior {
  static constexpr std::string_view kTag = "EDGE_PRIOR_TRACKXYZ";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<PointXYZ>;

  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& x, const Measured<S, 3>& z) noexcept {
    return {x[0] - z[0], x[1] - z[1], x[2] - z[2]};
  }
  template <class S>
  static Vector<S, 3> evaluate(const Vector<S, 3>& x, const Vector<S, 3>& z,
                               Eigen::Matrix<S, 3, 3>& J) noexcept {
    for (int k = 0; k < 9; ++k) J.data()[k] = k % 4 == 0 ? 1.0 : 0.0;
    return x - z;
  }

  static std::string normalize(Vector<double, 3>& z) { return PointXYZ::normalize(z); }
  static bool propagate(int, const double* const*, const double* z, double* out) {
    std::copy_n(z, 3, out);
    return true;
  }
};

}  // namespace cairn::slam3d
