// SPDX-License-Identifier: BSD-3-Clause
#include "odometry_scale.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cairn {
namespace {

/// As long as there are fewer matches, the model holds.
constexpr std::size_t kEnough = 20;
/// The part of the differences by which the scale is chosen, and the quantile of χ² with one degree
/// of freedom below which so many should be.
constexpr double kPart = 0.9, kQuantile = 2.7055;
/// Variances of a component: where the match is so much worse than odometry, it says nothing.
constexpr double kWorse = 4.0;
/// Least factor of a variance.
constexpr double kLeast = 0.1;

}  // namespace

Eigen::Matrix3d OdometryScale::scaled(const Eigen::Matrix3d& covariance) const {
  Eigen::Vector3d factor = Eigen::Vector3d::Ones();
  for (std::size_t k = 0; k < ratios_.size(); ++k) {
    const std::vector<double>& ratios = ratios_[k];
    if (ratios.size() < kEnough) continue;
    const auto at = static_cast<std::size_t>(kPart * static_cast<double>(ratios.size() - 1));
    factor[static_cast<Eigen::Index>(k)] = std::sqrt(std::max(ratios[at], kLeast));
  }
  return factor.asDiagonal() * covariance * factor.asDiagonal();
}

void OdometryScale::learn(const Eigen::Vector3d& apart, const Eigen::Matrix3d& covariance,
                          const Eigen::Matrix3d& noise) {
  const Eigen::Matrix3d expected = scaled(covariance);
  for (std::size_t k = 0; k < ratios_.size(); ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    if (noise(axis, axis) > kWorse * expected(axis, axis)) continue;
    const double ratio =
        (apart[axis] * apart[axis] / kQuantile - noise(axis, axis)) / covariance(axis, axis);
    std::vector<double>& ratios = ratios_[k];
    ratios.insert(std::ranges::upper_bound(ratios, ratio), ratio);
  }
}

}  // namespace cairn
