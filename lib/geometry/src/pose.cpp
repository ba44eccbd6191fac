// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "dense/products.hpp"

namespace cairn {

Pose pose_of(const Placement& placement, const double* x) {
  if (placement.dimension() == 3) {
    Pose pose;
    placement.split(x, pose.R.data(), pose.t.data());
    return pose;
  }
  Eigen::Matrix2d R = Eigen::Matrix2d::Identity();
  Eigen::Vector2d t;
  placement.split(x, R.data(), t.data());
  Pose pose;
  pose.R.topLeftCorner<2, 2>() = R;
  pose.t.head<2>() = t;
  return pose;
}

Eigen::Vector3d position(const VariableType& type, std::span<const double> x) {
  const Placement* placement = type.placement();
  if (!placement) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::array<double, 9> R;
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  placement->split(x.data(), R.data(), t.data());
  return t;
}

std::vector<double> moved_point(const VariableType& type, std::span<const double> x,
                                const Pose& motion) {
  const Pose at = pose_of(type, x);
  const Eigen::Vector3d t = motion.R * at.t + motion.t;
  std::vector<double> moved(x.begin(), x.end());
  type.placement()->join(at.R.data(), t.data(), moved.data());
  return moved;
}

std::vector<double> position_jacobian(const VariableType& type, std::span<const double> x) {
  const Placement* place = type.placement();
  if (!place) return {};
  const int n = type.tangent_size(), d = place->dimension();
  // Positions are smooth in δ, and a step of 1e-5 leaves ten digits of central differences.
  constexpr double kStep = 1e-5;
  std::vector<double> G(static_cast<std::size_t>(d) * static_cast<std::size_t>(n));
  Eigen::Map<Eigen::MatrixXd> derivative(G.data(), d, n);
  std::vector<double> delta(n, 0.0), moved(x.size()), R(d * d);
  const auto position = [&](int k, double step) {
    delta[k] = step;
    const std::int64_t offset = 0;
    type.retract(1, x.data(), &offset, delta.data(), moved.data());
    delta[k] = 0.0;
    Eigen::VectorXd t(d);
    place->split(moved.data(), R.data(), t.data());
    return t;
  };
  for (int k = 0; k < n; ++k)
    derivative.col(k) = (position(k, kStep) - position(k, -kStep)) / (2.0 * kStep);
  return G;
}

std::vector<double> position_covariance(const VariableType& type, std::span<const double> x,
                                        std::span<const double> sigma) {
  const Placement* place = type.placement();
  if (!place) return {};
  const int n = type.tangent_size(), d = place->dimension();
  const std::vector<double> derivative = position_jacobian(type, x);
  const Eigen::Map<const Eigen::MatrixXd> G(derivative.data(), d, n), Sigma(sigma.data(), n, n);
  std::vector<double> out(d * d);
  Eigen::Map<Eigen::MatrixXd>(out.data(), d, d) = dense::congruent(G, Sigma);
  return out;
}

/// ½(R − Rᵀ) has sin θ times the axis in its strict lower triangle, and tr R = 1 + 2 cos θ.
double rotation_angle(const Eigen::Matrix3d& R) {
  double square = 0.0;
  for (int column = 0; column < 3; ++column) {
    for (int row = column + 1; row < 3; ++row) {
      const double half = 0.5 * (R(row, column) - R(column, row));
      square += half * half;
    }
  }
  return std::atan2(std::sqrt(square), 0.5 * (R(0, 0) + R(1, 1) + (R(2, 2) - 1.0)));
}

}  // namespace cairn
