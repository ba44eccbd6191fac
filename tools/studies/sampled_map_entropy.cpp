// SPDX-License-Identifier: BSD-3-Clause
#include "sampled_map_entropy.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <fmt/core.h>
#include <Eigen/Cholesky>

#include "cairn/io/random_numbers.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

void check(const PoseGaussian& poses, std::span<const AttachedScan> scans, int samples) {
  const auto size = static_cast<Eigen::Index>(3 * poses.mean.size());
  if (samples < 2)
    throw Error(ErrorCode::usage, fmt::format("sampled map entropy: {} samples, which must be 2 or "
                                              "more",
                                              samples));
  if (poses.covariance.rows() != size || poses.covariance.cols() != size)
    throw Error(ErrorCode::usage,
                fmt::format("sampled map entropy: a covariance of {} × {} for {} poses",
                            poses.covariance.rows(), poses.covariance.cols(), poses.mean.size()));
  for (const AttachedScan& scan : scans) {
    if (scan.pose >= poses.mean.size())
      throw Error(ErrorCode::usage, fmt::format("sampled map entropy: a scan at pose {} of {}",
                                                scan.pose, poses.mean.size()));
  }
}

/// A lower triangular L with L Lᵀ = Σ, of a matrix that may be singular: a pivot that is zero but
/// for rounding leaves its column zero. The first rows do not depend on later poses.
Eigen::MatrixXd semidefinite_root(const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = covariance.rows();
  constexpr double kRounding = 1e-9;  // relative to the diagonal
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double diagonal = covariance(j, j);
    const double pivot = diagonal - L.row(j).head(j).squaredNorm();
    if (!(pivot >= -kRounding * diagonal))  // not for NaN either
      throw Error(ErrorCode::numerical,
                  "sampled map entropy: the covariance is not positive semidefinite");
    if (pivot <= kRounding * diagonal) continue;
    const double root = std::sqrt(pivot);
    const Eigen::Index below = n - j - 1;
    L(j, j) = root;
    L.col(j).tail(below) = (covariance.col(j).tail(below) -
                            L.bottomLeftCorner(below, j) * L.row(j).head(j).transpose()) /
                           root;
  }
  return L;
}

/// From that of an unknown map.
double entropy_beside_unknown(const FloorMap& map) {
  return map.entropy() -
         std::numbers::ln2 * map.frame.cell_area() * static_cast<double>(map.log_odds.size());
}

double mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double standard_error(std::span<const double> values) {
  const auto count = static_cast<double>(values.size());
  const double centre = mean(values);
  double squares = 0.0;
  for (const double value : values) squares += (value - centre) * (value - centre);
  return std::sqrt(squares / (count * (count - 1.0)));
}

}  // namespace

SampledMapEntropy sampled_map_entropy(const PoseGaussian& poses,
                                      std::span<const AttachedScan> scans, Mapper& mapper,
                                      int samples, std::uint64_t seed) {
  check(poses, scans, samples);
  const Eigen::MatrixXd root = semidefinite_root(poses.covariance);
  const auto taken_at = [&](const std::vector<Pose2>& at, const AttachedScan& scan) {
    return at[scan.pose] * scan.offset;
  };
  mapper.reset();
  for (const AttachedScan& scan : scans) mapper.add(taken_at(poses.mean, scan), scan.scan);

  SampledMapEntropy result;
  result.at_mean = entropy_beside_unknown(mapper.map());
  Eigen::VectorXd normal(root.rows());
  std::vector<Pose2> sampled(poses.mean.size()), places(scans.size());
  for (int k = 0; k < samples; ++k) {
    RandomNumbers random(
        RandomNumbers::mixed(RandomNumbers::mixed(seed) + static_cast<std::uint64_t>(k)));
    for (double& number : normal) number = random.gaussian();
    const Eigen::VectorXd step = root * normal;
    for (std::size_t i = 0; i < sampled.size(); ++i) {
      const auto row = 3 * static_cast<Eigen::Index>(i);
      sampled[i] = poses.mean[i] * Pose2::exp(step.segment<3>(row));
    }
    std::ranges::transform(scans, places.begin(),
                           [&](const AttachedScan& scan) { return taken_at(sampled, scan); });
    mapper.move(places);
    result.samples.push_back(entropy_beside_unknown(mapper.map()));
  }
  result.mean = mean(result.samples);
  result.standard_error = standard_error(result.samples);
  return result;
}

}  // namespace cairn
