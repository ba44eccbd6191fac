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
  using Jacobian = Eigen::Matrix<double, 6, 6>;

  template <class S>
  static Vector<S, 6> residual(const Vector<S, 7>& a, const Vector<S, 7>& b,
                               const Vector<double, 7>& z) {
    const Vector<S, 7> z_ab = z.template cast<S>();
    return Metric::template error<S>(Se3::between<S>(z_ab, Se3::between<S>(a, b)));
  }

  /// With M = a⁻¹ b = (p, R_m) and E = z⁻¹ M: moving b moves E to E exp(δ), and moving a moves it
  /// to E exp(−Ad(M⁻¹) δ), Ad(M⁻¹) = [R_mᵀ −R_mᵀ[p]ₓ; 0 R_mᵀ].
  static Vector<double, 6> evaluate(const Vector<double, 7>& a, const Vector<double, 7>& b,
                                    const Vector<double, 7>& z, Jacobian& J_a, Jacobian& J_b) {
    const Vector<double, 7> M = Se3::between<double>(a, b);
    ErrorDerivative D;
    const Vector<double, 6> e = Metric::derivative(Se3::between<double>(z, M), D);

    const Eigen::Matrix3d R = -so3::matrix<double>(Se3::quaternion<double>(M)).transpose();
    Eigen::Matrix3d translation, rotation, cross;  // the blocks of J_a
    translation.noalias() = D.translation.lazyProduct(R);
    rotation.noalias() = D.rotation.lazyProduct(R);
    cross.noalias() = D.cross.lazyProduct(R);
    for (int row = 0; row < 3; ++row) {  // cross −= translation [p]ₓ
      const double x = translation(row, 0), y = translation(row, 1), w = translation(row, 2);
      cross(row, 0) -= y * M[2] - w * M[1];
      cross(row, 1) -= w * M[0] - x * M[2];
      cross(row, 2) -= x * M[1] - y * M[0];
    }
    assemble(translation, cross, rotation, J_a);
    assemble(D.translation, D.cross, D.rotation, J_b);
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

 private:
  static void assemble(const Eigen::Matrix3d& translation, const Eigen::Matrix3d& cross,
                       const Eigen::Matrix3d& rotation, Jacobian& J) {
    J.topLeftCorner<3, 3>() = translation;
    J.topRightCorner<3, 3>() = cross;
    J.bottomLeftCorner<3, 3>().setZero();
    J.bottomRightCorner<3, 3>() = rotation;
  }
};

}  // namespace cairn::slam3d
