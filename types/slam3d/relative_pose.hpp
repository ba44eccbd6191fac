// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"
#include "metrics.hpp"

namespace cairn::slam3d {

/// Relative pose z = (x y z [m], qx qy qz qw) of pose b as seen from pose a: error = Metric(z⁻¹
/// (a⁻¹ b)).
template <class Metric>
struct RelativePose {
  static constexpr std::string_view kTag = "EDGE_SE3:QUAT";
  static constexpr int kResidual = 6, kMeasurement = 7;
  static constexpr bool kRelative = true;
  static constexpr std::string_view kMetric = Metric::kName;
  using Variables = std::tuple<Se3, Se3>;

  template <class S>
  static Vector<S, 6> residual(const Vector<S, 7>& a, const Vector<S, 7>& b,
                               const Measured<S, 7>& z) noexcept {
    const Vector<S, 7> z_ab = z.template cast<S>();
    return Metric::template error<S>(Se3::between<S>(z_ab, Se3::between<S>(a, b)));
  }

  /// With M = a⁻¹ b = (p, R_m) and E = z⁻¹ M: moving b moves E to E exp(δ), and moving a moves it
  /// to E exp(−Ad(M⁻¹) δ), Ad(M⁻¹) = [R_mᵀ −R_mᵀ[p]ₓ; 0 R_mᵀ].
  template <class S>
  static Vector<S, 6> evaluate(const Vector<S, 7>& a, const Vector<S, 7>& b, const Vector<S, 7>& z,
                               Eigen::Matrix<S, 6, 6>& J_a, Eigen::Matrix<S, 6, 6>& J_b) noexcept {
    const Vector<S, 7> M = Se3::between<S>(a, b);
    ErrorDerivative<S> D;
    const Vector<S, 6> e = Metric::template derivative<S>(Se3::between<S>(z, M), D);
    D.assemble(J_b);

    const so3::Matrix3<S> R = -so3::matrix<S>(Se3::quaternion<S>(M)).transpose();
    ErrorDerivative<S> D_a;
    D_a.translation = so3::times<S>(D.translation, R);
    D_a.rotation = so3::times<S>(D.rotation, R);
    D_a.cross = so3::times<S>(D.cross, R);
    for (int row = 0; row < 3; ++row) {  // cross −= translation [p]ₓ
      const S x = D_a.translation(row, 0), y = D_a.translation(row, 1), w = D_a.translation(row, 2);
      D_a.cross(row, 0) -= y * M[2] - w * M[1];
      D_a.cross(row, 1) -= w * M[0] - x * M[2];
      D_a.cross(row, 2) -= x * M[1] - y * M[0];
    }
    D_a.assemble(J_a);
    return e;
  }

  static std::string normalize(Vector<double, 7>& z) { return Se3::normalize(z); }

  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    using State = Vector<double, 7>;
    const State z_ab = Eigen::Map<const State>(z);
    State missing = target == 1 ? Se3::compose<double>(Eigen::Map<const State>(x[0]), z_ab)
                                : Se3::compose<double>(Eigen::Map<const State>(x[1]),
                                                       Se3::inverse<double>(z_ab));
    Se3::normalize(missing);  // chains of these are long
    Eigen::Map<State>{out} = missing;
    return true;
  }
};

}  // namespace cairn::slam3d
