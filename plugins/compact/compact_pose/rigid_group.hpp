// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>

#include <Eigen/Core>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn::compact {

/// Of the tangent space of a pose, in the plane or in space.
using Matrix = PoseGroup::Matrix;
using Vector = PoseGroup::Tangent;
using State = PoseGroup::State;

/// A pose with what displacements from and to it take.
struct PlacedState {
  State x{}, inverse{};
  Pose at;
};

/// x_i⁻¹ x_n of two estimated poses, and its covariance (equations 16 and 17).
struct Displacement {
  State mean{};
  Pose at;            ///< the same
  Matrix adjoint;     ///< Ad(mean⁻¹): a step of x_i moves the displacement by −adjoint · step
  Matrix covariance;  ///< of ξ, mean · exp(ξ)
};

/// Poses that are rigid transformations of the plane or of space, whatever type implements them:
/// its abilities `LieGroup` and `Placement`, checked to belong together.
class RigidGroup : public PoseGroup {
 public:
  /// Throws `Error` (usage) for a type whose states are not rigid transformations.
  explicit RigidGroup(const std::shared_ptr<const VariableType>& type);

  const MotionGroup& motions() const { return motions_; }
  int dimension() const { return dimension_; }

  PlacedState place(const State& x) const;
  /// All measurements of the relative pose of two poses, fused. Throws `Error` (input) if one of
  /// them measures something else.
  Motion fuse(std::span<const Factor> factors, Id from, Id to) const;

  /// Where x_n is as seen from x_i.
  static Pose seen_from(const PlacedState& x_i, const PlacedState& x_n);
  /// x_i⁻¹ x_n without its covariance.
  Displacement displacement(const PlacedState& x_i, const PlacedState& x_n) const;
  /// Its covariance from those of the poses: Σ_nn + A Σ_ii Aᵀ − A Σ_in − (A Σ_in)ᵀ, A = Ad(mean⁻¹).
  void set_covariance(const Matrix& S_ii, const Matrix& S_in, const Matrix& S_nn,
                      Displacement& displacement) const;

  /// The covariance of a tangent vector ξ as one of (velocity, angular velocity) in the body's
  /// frame: six rows, those that a plane does not have are zero.
  Eigen::Matrix<double, 6, 6> twist_covariance(const Matrix& covariance) const;
  /// How a point of the body that is at `point` in the world moves there with a step ξ of a pose,
  /// x exp(ξ): R (v + ω × Rᵀ (point − t)), three rows.
  Eigen::Matrix3Xd point_jacobian(const Pose& at, const Eigen::Vector3d& point) const;
  /// The inverse of `twist_covariance`, for independent components: the covariance of ξ for
  /// standard deviations of translation [m] and rotation [rad] along every axis.
  Matrix isotropic(double sigma_translation, double sigma_rotation) const;

 private:
  void check_rigid() const;

  MotionGroup motions_;
  const Placement* placement_;
  int dimension_;
  /// (velocity, angular velocity) of a tangent vector; constant, since perturbations stand on the
  /// right.
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, PoseSize::kMostTangent> twist_;
  bool twist_is_identity_ = false;
};

/// ½ ln(|Σ_y + Σ_d| / |Σ_y|): the information gain of a measurement with covariance Σ_y of a
/// displacement with covariance Σ_d [nats] (equation 22); `information_gain`, and 0 where rounding
/// has left no covariance.
double mutual_information(const Matrix& S_y, const Matrix& S_d);

Matrix to_matrix(std::span<const double> numbers, int n);

}  // namespace cairn::compact
