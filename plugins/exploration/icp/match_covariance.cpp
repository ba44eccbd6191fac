// SPDX-License-Identifier: BSD-3-Clause
#include "match_covariance.hpp"

#include <algorithm>
#include <cmath>

#include "dense/eigenvalues.hpp"

namespace cairn::icp {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Of a Gaussian: median of |x| over the standard deviation.
constexpr double kMedian = 0.6745;

/// An observed direction has at least so many times the information of the normals' noise, and at
/// most this standard deviation [m].
constexpr double kObserved = 4.0, kMostObserved = 0.3;
/// Factor on standard deviations, for errors that neighbouring points share.
constexpr double kInflation = 1.05;
/// Least standard deviation of any direction [m].
constexpr double kFloor = 0.001;

/// The distance by which an angle is multiplied to be a length [m].
double lever(const SurfaceScan& moving, const std::vector<PointMatch>& matches) {
  double sum = 0.0;
  for (const PointMatch& match : matches) {
    sum += match.inverse ? moving.line(match.line).centre.squaredNorm()
                         : moving.point(match.point).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(matches.size()));
}

/// Residuals that are larger than the scans' noise explains make all variances larger.
double residual_scale(const std::vector<PointMatch>& matches) {
  std::vector<double> ratios;
  ratios.reserve(matches.size());
  for (const PointMatch& match : matches)
    ratios.push_back(std::abs(match.residual) / std::sqrt(match.variance));
  const auto middle = ratios.begin() + std::ssize(ratios) / 2;
  std::nth_element(ratios.begin(), middle, ratios.end());
  return std::max(1.0, *middle / kMedian);
}

/// Σ a aᵀ σ² over the points of both scans.
Matrix3d gradient_covariance(const SurfaceScan& reference, const SurfaceScan& moving,
                             const std::vector<PointMatch>& matches) {
  std::vector<Vector3d> of_reference(static_cast<std::size_t>(reference.size()), Vector3d::Zero());
  std::vector<Vector3d> of_moving(static_cast<std::size_t>(moving.size()), Vector3d::Zero());
  for (const PointMatch& match : matches) {
    const Vector3d a = match.J / match.variance;
    auto& points = match.inverse ? of_reference : of_moving;
    auto& others = match.inverse ? of_moving : of_reference;
    const SurfaceScan& scan = match.inverse ? moving : reference;
    points[static_cast<std::size_t>(match.point)] += a;
    const SurfaceLine& line = scan.line(match.line);
    for (int k = line.first; k < line.first + line.count; ++k) {
      const double along = line.tangent.dot(scan.point(k) - line.centre);
      others[static_cast<std::size_t>(k)] -= line.leverage(match.along, along) * a;
    }
  }
  Matrix3d sum = Matrix3d::Zero();
  const auto add = [&](const SurfaceScan& scan, const std::vector<Vector3d>& parts) {
    for (int k = 0; k < scan.size(); ++k) {
      const Vector3d& a = parts[static_cast<std::size_t>(k)];
      sum += scan.point_variance(k) * a * a.transpose();
    }
  };
  add(reference, of_reference);
  add(moving, of_moving);
  return sum;
}

}  // namespace

MatchCovariance match_covariance(const SurfaceScan& reference, const SurfaceScan& moving,
                                 const std::vector<PointMatch>& matches,
                                 const CovarianceOptions& options) {
  MatchCovariance result;
  const double least = kFloor * kFloor;
  const double unknown = options.unobserved * options.unobserved;
  if (matches.empty()) {
    result.covariance = unknown * Matrix3d::Identity();
    result.unobserved = 3;
    return result;
  }
  Matrix3d H = Matrix3d::Zero(), S = Matrix3d::Zero();
  for (const PointMatch& match : matches) {
    H += match.J * match.J.transpose() / match.variance;
    const SurfaceScan& lines = match.inverse ? moving : reference;
    S += lines.line(match.line).angle_variance() / match.variance * match.J_turn *
         match.J_turn.transpose();
  }
  result.scale = residual_scale(matches);
  // In lengths: ξ = D η.
  const double length = std::max(lever(moving, matches), 0.1);
  const Matrix3d D = Vector3d(1.0, 1.0, 1.0 / length).asDiagonal();
  const Matrix3d H_length = D * H * D;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(H_length);
  const Matrix3d V = D * eigen.eigenvectors();
  const Matrix3d G = V.transpose() * gradient_covariance(reference, moving, matches) * V;
  const double inflation = std::pow(result.scale * kInflation, 2);
  // Directions, as columns; error of each per gradient.
  Vector3d gain = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const double noise = V.col(k).dot(S * V.col(k));
    const double information = eigen.eigenvalues()[k];
    if (information > kObserved * noise &&
        inflation * G(k, k) < std::pow(kMostObserved * (information - noise), 2)) {
      gain[k] = 1.0 / (information - noise);
    } else {
      ++result.unobserved;
    }
  }
  Matrix3d sigma = inflation * gain.asDiagonal() * G * gain.asDiagonal();
  const double across = result.unobserved > 0 ? unknown * options.tilt * options.tilt : 0.0;
  for (int k = 0; k < 3; ++k) sigma(k, k) += gain[k] > 0.0 ? least + across : unknown;
  result.weakest = V.col(0);
  result.covariance = V * sigma * V.transpose();
  result.covariance = 0.5 * (result.covariance + result.covariance.transpose()).eval();
  return result;
}

}  // namespace cairn::icp
