// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

// Kinds of variables ------------------------------------------------------------------------------

/// Whether a variable of this type has a position in the plane or in space: a pose or a point.
inline bool has_position(const VariableType& type) { return type.placement() != nullptr; }
/// Whether it has an orientation as well. A camera whose focal length is a part of its state has
/// both, and is not a pose of a Lie group.
inline bool has_orientation(const VariableType& type) {
  const Placement* placement = type.placement();
  return placement && placement->has_orientation();
}
/// A position without orientation: a landmark. Types that have no position are not points.
inline bool is_point(const VariableType& type) {
  const Placement* placement = type.placement();
  return placement && !placement->has_orientation();
}
/// A pose: position and orientation, and states that form a Lie group.
inline bool is_pose(const VariableType& type) { return type.lie_group() && has_orientation(type); }

// Position and orientation ------------------------------------------------------------------------

/// A pose in space: p_world = R p_body + t. A pose in the plane turns about z and lies in z = 0.
struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();  ///< [m]
};

/// The pose of a state; for a point R = I.
CAIRN_API Pose pose_of(const Placement& placement, const double* x);
/// The same. The type must have a position.
inline Pose pose_of(const VariableType& type, std::span<const double> x) {
  return pose_of(*type.placement(), x.data());
}
/// The position of a state [m], z = 0 in the plane; NaN for a type without positions.
CAIRN_API Eigen::Vector3d position(const VariableType& type, std::span<const double> x);

/// The state of a point (`is_point`) after a rigid motion, p ← R p + t.
CAIRN_API std::vector<double> moved_point(const VariableType& type, std::span<const double> x,
                                          const Pose& motion);

/// The derivative of where a variable is in the world [m] by δ at `x`, retract(x, δ): dimension ×
/// tangent, column-major. None for a type without the ability `Placement`.
CAIRN_API std::vector<double> position_jacobian(const VariableType& type,
                                                std::span<const double> x);

/// The covariance of where a variable is, in the world frame [m²]: G Σ_vv Gᵀ with G the derivative
/// of its position by δ at `x`. `sigma`: tangent × tangent doubles. Returns dimension × dimension
/// doubles; none for a type without the ability `Placement`.
CAIRN_API std::vector<double> position_covariance(const VariableType& type,
                                                  std::span<const double> x,
                                                  std::span<const double> sigma);

/// The angle of a rotation, 0 to π [rad], to full precision everywhere: the arc cosine of the trace
/// loses half of the digits at 0 and at π.
CAIRN_API double rotation_angle(const Eigen::Matrix3d& R);

}  // namespace cairn
