// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

#include "cairn/types/variable_type.hpp"
#include "measured.hpp"
#include "observations.hpp"
#include "rigid_group.hpp"

namespace cairn::compact {

/// What is not known of where a landmark lies to a pose, as a covariance of steps of the landmark
/// while the pose is held: C Σ Cᵀ, C = (I, −M), where M ξ is the step of the landmark that a step ξ
/// of the pose carries along. `joint`: Σ of the landmark and, after it, the pose. Where the two are
/// in the world may be as uncertain as it likes.
Eigen::MatrixXd beside_pose(const RigidGroup& group, const PlacedState& pose,
                            const VariableType& type, std::span<const double> landmark,
                            const Eigen::MatrixXd& joint);

/// What a pose measures of a landmark.
struct LandmarkView {
  const VariableType& type;
  std::span<const double> landmark;
  std::span<const Measured> factors;
  Id pose = 0;
  const State& x;
};

/// How far a measurement is from linear over such a covariance S: the largest √(dᵀ V⁻¹ d) of its
/// sigma points, where d = e(l ⊕ s) − e(l) − J_l s is what the residual differs by from that of the
/// linear model, and V = I + J_l S J_lᵀ what is expected of it, so that 1 is a standard deviation.
/// The sigma points s = Σ_k c_k σ_k v_k, each c_k of −1, 0 and 1, are one standard deviation to
/// either side along the axes v_k of S, and the corners between: of a bearing it is the product of
/// what is not known along and across that is not linear. Infinite where e is not a number.
/// `rows`: the linear model.
double nonlinearity(const LandmarkView& view, const ObservationRows& rows,
                    const Eigen::MatrixXd& S);

/// Measurements that are not linear by more than this are left out. A bearing of a landmark that is
/// known to σ in each direction is, from a distance of 2.4 σ on; if it is known to σ along alone,
/// from 2.4 to 3 σ.
constexpr double kMostNonlinear = 0.5;

}  // namespace cairn::compact
