// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/laser_scan.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Poses in the plane, x_i = mean_i exp(δ_i) with δ ~ N(0, Σ).
struct PoseGaussian {
  std::vector<Pose2> mean;
  Eigen::MatrixXd covariance;  ///< Σ, three rows for each pose; may be singular
};

/// A scan that was taken at one of several poses, or at an offset from it.
struct AttachedScan {
  std::size_t pose = 0;
  Pose2 offset;  ///< in the frame of that pose
  LaserScan scan;
};

/// The expected entropy of a map under uncertain poses.
struct SampledMapEntropy {
  double mean = 0.0;            ///< estimate of ∫ p(x) H(m|x) dx [nats·m²]
  double standard_error = 0.0;  ///< of that estimate
  double at_mean = 0.0;         ///< H(m|x) at the mean of p(x)
  std::vector<double> samples;  ///< H(m|x) of each
};

/// ∫ p(x) H(m|x) dx, the second term of the joint entropy of trajectory and map (thesis, 5.3), by
/// samples of p(x): for each the map is made of all scans at the sampled poses. The entropy is
/// counted from that of a wholly unknown map, Σ (H(c) − l² ln 2) over the cells, so that it does
/// not depend on how far a grid reaches; it is never above zero.
///
/// The same seed gives the same samples of δ for the poses that come first: what is compared meets
/// the same errors. Takes samples + 1 maps; `mapper` is reset. Throws `Error` (usage) for less than
/// two samples, sizes that do not fit, or a scan at a pose that is not there, (numerical) if Σ is
/// not positive semidefinite or not finite.
SampledMapEntropy sampled_map_entropy(const PoseGaussian& poses,
                                      std::span<const AttachedScan> scans, Mapper& mapper,
                                      int samples, std::uint64_t seed);

}  // namespace cairn
