// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/path_information.hpp"
#include "cairn/plugin/registry.hpp"
#include "sampled_map_entropy.hpp"

namespace cairn {

/// What a path is expected to do: what an objective weighs, and the same by samples.
struct SampledPath {
  double length = 0.0;                                ///< [m]
  int loops = 0;                                      ///< closed on it
  double trajectory = 0.0;                            ///< change of (5.13) [nats]
  double map = 0.0;                                   ///< expected change of (5.6) [nats·m²]
  Eigen::Matrix3d now = Eigen::Matrix3d::Identity();  ///< Σ of the robot's pose before the path
  Eigen::Matrix3d end = Eigen::Matrix3d::Identity();  ///< and at its end
  double sampled_map = 0.0;     ///< change of ∫ p(x) H(m|x) dx [nats·m²], by samples
  double standard_error = 0.0;  ///< of that change
};

struct PathSamplerOptions {
  int samples = 200;
  double range = 4.0;  ///< of the scans that are expected on a path [m]
  PathInformationOptions information = {};
};

/// Measures what a path is expected to do to the joint entropy of trajectory and map as it is
/// defined (thesis, 5.3), H(x) + ∫ p(x) H(m|x) dx, beside what (5.4) takes for it. On a copy of the
/// estimator the path gets its poses and loop closures, and each of its poses a scan as the map
/// lets expect it: beams end at known obstacles, and what is unknown is free up to the simulated
/// range. Both integrals, before and after, are by the same samples.
class PathSampler {
 public:
  /// `scans` and `poses`: all that the map was made of, and where each was taken; scan k belongs to
  /// the last pose of the graph with an id up to k. `registry`: of the types of poses and factors.
  /// `mapper` is used for every sample; it should draw scans again however little they move
  /// (`log_odds:tolerance=0`). All that is referred to must outlive it. Throws `Error` (usage) if
  /// there are not as many scans as poses.
  PathSampler(const Situation& situation, std::span<const LaserScan> scans,
              std::span<const Pose2> poses, Mapper& mapper, Registry& registry,
              const PathSamplerOptions& options, std::uint64_t seed);
  PathSampler(const PathSampler&) = delete;
  PathSampler& operator=(const PathSampler&) = delete;
  ~PathSampler();

  /// Time of `samples` maps.
  SampledPath sample(const PlannedPath& path);

 private:
  class Model;
  std::unique_ptr<Model> model_;
};

}  // namespace cairn
