// SPDX-License-Identifier: BSD-3-Clause
#include "rigid_group.hpp"

#include <cmath>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Geometry>

#include "cairn/information/gaussian.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"

namespace cairn::compact {
namespace {

// The arithmetic of a candidate, for each of the two sizes.

template <int N>
using Fixed = Eigen::Matrix<double, N, N>;
/// Entries of a matrix of that size, which lie side by side.
template <int N>
Eigen::Map<const Fixed<N>> fixed(const Matrix& M) {
  return Eigen::Map<const Fixed<N>>(M.data());
}

template <int N>
void set_covariance_of(const Matrix& S_ii, const Matrix& S_in, const Matrix& S_nn,
                       Displacement& d) {
  const auto A = fixed<N>(d.adjoint);
  Fixed<N> left;
  left.noalias() = A.lazyProduct(fixed<N>(S_ii));
  Fixed<N> AS, sum;
  AS.noalias() = A.lazyProduct(fixed<N>(S_in));
  sum.noalias() = left.lazyProduct(A.transpose());
  sum += fixed<N>(S_nn) - AS - AS.transpose();
  d.covariance = sum;
}

[[noreturn]] void refuse(const VariableType& type, const std::string& why) {
  throw Error(ErrorCode::usage,
              "compact_pose takes graphs of poses that are rigid transformations, and " +
                  std::string(type.tag()) + " " + why);
}

const VariableType& pose_type(const std::shared_ptr<const VariableType>& type) {
  if (!type) throw Error(ErrorCode::usage, "compact_pose: a pose without a type");
  if (!has_orientation(*type)) refuse(*type, "has no position and heading");
  return *type;
}

}  // namespace

RigidGroup::RigidGroup(const std::shared_ptr<const VariableType>& type)
    : PoseGroup(pose_type(type)),
      motions_(type),
      placement_(type->placement()),
      dimension_(placement_->dimension()) {
  if (tangent_size() != (dimension_ == 2 ? 3 : 6))
    refuse(*type, "has " + std::to_string(tangent_size()) + " degrees of freedom");
  // exp is smooth: central differences with this step leave eleven digits.
  constexpr double kStep = 1e-4;
  twist_.resize(6, tangent_size());
  for (int k = 0; k < tangent_size(); ++k) {
    Vector step = Vector::Zero(tangent_size());
    step[k] = kStep;
    const Pose a = pose_of(*placement_, exp(step).data());
    const Pose b = pose_of(*placement_, exp(-step).data());
    twist_.col(k).head<3>() = (a.t - b.t) / (2.0 * kStep);
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(b.R.transpose() * a.R));
    twist_.col(k).tail<3>() = turn.angle() * turn.axis() / (2.0 * kStep);
  }
  twist_ = twist_.unaryExpr(
      [](double x) { return std::abs(x - std::round(x)) < 1e-6 ? std::round(x) : x; });
  twist_is_identity_ = tangent_size() == 6 && twist_ == Eigen::MatrixXd::Identity(6, 6);
  check_rigid();
}

/// R_ab = R_a R_b and t_ab = t_a + R_a t_b, tried on a few elements.
void RigidGroup::check_rigid() const {
  Vector tangent(tangent_size());
  for (int trial = 0; trial < 4; ++trial) {
    State x[2]{};
    for (int side = 0; side < 2; ++side) {
      for (int k = 0; k < tangent_size(); ++k) tangent[k] = std::sin(1.0 + trial + 2.7 * k + side);
      x[side] = exp(tangent);
    }
    const State product = compose(x[0], x[1]);
    const Pose a = pose_of(*placement_, x[0].data()), b = pose_of(*placement_, x[1].data()),
               ab = pose_of(*placement_, product.data());
    if ((ab.R - a.R * b.R).norm() > 1e-9 || (ab.t - a.t - a.R * b.t).norm() > 1e-9)
      refuse(motions_.type(), "composes in another way");
  }
}

Motion RigidGroup::fuse(std::span<const Factor> factors, Id from, Id to) const {
  const auto refuse = [](const std::string& message) { throw Error(ErrorCode::input, message); };
  if (factors.empty())
    refuse(fmt::format("no measured relative pose from pose {} to {}", from, to));
  Motion all;
  for (const Factor& factor : factors) {
    const auto& on = factor.variables;
    const bool forwards = on == std::vector<Id>{from, to}, back = on == std::vector<Id>{to, from};
    if (!forwards && !back)
      refuse(fmt::format("a measurement that is not between poses {} and {}", from, to));
    if (!factor.type) refuse("a measurement without a type");
    if (!factor.type->is_relative() ||
        factor.type->variable_tags().front() != motions_.type().tag()) {
      refuse(fmt::format("{} between {} and {} is not a relative pose of {}", factor.type->tag(),
                         from, to, motions_.type().tag()));
    }
    const Motion motion = motions_.of_factor(factor, from);
    all = all.mean.empty() ? motion : motions_.fuse(all, motion);
  }
  return all;
}

PlacedState RigidGroup::place(const State& x) const {
  return {x, inverse(x), pose_of(*placement_, x.data())};
}

Pose RigidGroup::seen_from(const PlacedState& x_i, const PlacedState& x_n) {
  return {x_i.at.R.transpose() * x_n.at.R, x_i.at.R.transpose() * (x_n.at.t - x_i.at.t)};
}

Displacement RigidGroup::displacement(const PlacedState& x_i, const PlacedState& x_n) const {
  return {
      compose(x_i.inverse, x_n.x), seen_from(x_i, x_n), adjoint(compose(x_n.inverse, x_i.x)), {}};
}

void RigidGroup::set_covariance(const Matrix& S_ii, const Matrix& S_in, const Matrix& S_nn,
                                Displacement& d) const {
  if (tangent_size() == 3) {
    set_covariance_of<3>(S_ii, S_in, S_nn, d);
  } else {
    set_covariance_of<6>(S_ii, S_in, S_nn, d);
  }
}

Eigen::Matrix<double, 6, 6> RigidGroup::twist_covariance(const Matrix& covariance) const {
  if (twist_is_identity_) return fixed<6>(covariance);
  return twist_ * covariance * twist_.transpose();
}

Eigen::Matrix3Xd RigidGroup::point_jacobian(const Pose& at, const Eigen::Vector3d& point) const {
  const Eigen::Vector3d p = at.R.transpose() * (point - at.t);
  Eigen::Matrix3d cross;  // of p
  cross << 0.0, -p.z(), p.y(), p.z(), 0.0, -p.x(), -p.y(), p.x(), 0.0;
  return at.R * (twist_.topRows<3>() - cross * twist_.bottomRows<3>());
}

Matrix RigidGroup::isotropic(double sigma_translation, double sigma_rotation) const {
  // Information, since a plane's twists are fewer than six: Σ⁻¹ = Tᵀ W T.
  Eigen::Matrix<double, 6, 1> weights;
  weights.head<3>().setConstant(1.0 / (sigma_translation * sigma_translation));
  weights.tail<3>().setConstant(1.0 / (sigma_rotation * sigma_rotation));
  const Matrix information = twist_.transpose() * weights.asDiagonal() * twist_;
  return Eigen::MatrixXd(information).inverse();
}

double mutual_information(const Matrix& S_y, const Matrix& S_d) {
  try {
    return information_gain(S_d, S_y);
  } catch (const Error& error) {
    // Where all is known far better than rounding lets the covariances show, Σ_d may be anything.
    if (error.code() != ErrorCode::numerical) throw;
    return 0.0;
  }
}

Matrix to_matrix(std::span<const double> numbers, int n) {
  return Eigen::Map<const Eigen::MatrixXd>(numbers.data(), n, n);
}

}  // namespace cairn::compact
