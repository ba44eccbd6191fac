// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/types/variable_type.hpp"
#include "measured.hpp"
#include "rigid_group.hpp"

namespace cairn::compact {

/// What one pose measures of a landmark: factors on the two.
struct View {
  Id pose = 0;
  std::vector<Measured> factors;
};

/// The same, with the pose's estimate.
struct PlacedView {
  std::span<const Measured> factors;
  Id pose = 0;
  State x{};
  Eigen::Vector3d at;  ///< where that is [m]; z = 0 in the plane
  Matrix to_last;      ///< Ad(x⁻¹ x_last)
};

/// Where a landmark is by what several poses measure of it.
struct Triangulation {
  std::vector<double> state;
  /// Of all views together with the poses, the landmark being free: with the whitened residual e
  /// and its Jacobians J_p, J_l, and with P = I − J_l (J_lᵀ J_l)⁻¹ J_lᵀ, which takes out what the
  /// landmark can explain, e' = P e and R = P J_p: gain = ½ ln |I + R Σ Rᵀ| is the entropy that the
  /// poses lose by the views [nats], innovation = e'ᵀ (I + R Σ Rᵀ)⁻¹ e'.
  MeasuredFit fit;
};

/// Where a point is by views of which no single one has to determine it, such as bearings or
/// ranges; nothing: they do not determine it. `covariance`: the joint Σ of their poses in order;
/// each pose stands once.
///
/// A motion of all poses together moves the point with them, so what counts is how they lie to the
/// last, x_n: a step of the k-th is δ_k − Ad(x_k⁻¹ x_n) δ_n then, and that of the last is zero.
/// With the covariance Σ' of these steps, and V = I + J_p Σ' J_pᵀ, the point is where J_lᵀ V⁻¹ e =
/// 0, and its information is Λ = J_lᵀ V⁻¹ J_l. It is determined if
///
/// - what is measured is linear over what is left uncertain: one standard deviation to either side
///   along each eigenvector of Λ, −ln p = ½ eᵀ V⁻¹ e differs from that of the linear model by less
///   than ½ nat. Where little parallax makes the depth d uncertain by σ, that is about σ < 0.29 d;
/// - there is no other such place that is more likely than `trust` times this one (two ranges have
///   two). Places are searched for along directions from the last pose, and mirrored.
std::optional<Triangulation> triangulate(const VariableType& type,
                                         std::span<const PlacedView> views,
                                         const Eigen::MatrixXd& covariance, double trust);

}  // namespace cairn::compact
