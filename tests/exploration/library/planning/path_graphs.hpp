// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/planning/path_information.hpp"
#include "cairn/typed/build.hpp"

namespace cairn::test {

/// A pose graph for paths to start from; what a `Situation` refers to.
struct PathGraph {
  std::unique_ptr<Estimator> estimator;
  std::vector<Id> poses;
  FloorMap map;
  RobotModel robot;
  MatchModel match;
  Eigen::Vector3d first_sigma = Eigen::Vector3d(0.05, 0.03, 0.0017);
  Pose2 pose;  ///< where the robot is

  Situation situation() const {
    return {.estimator = *estimator,
            .poses = poses,
            .pose = pose,
            .map = map,
            .robot = robot,
            .match = match,
            .first_sigma = first_sigma};
  }
};

/// A walk of `poses` poses in a square of `side` metres, with odometry and loop closures, noisy and
/// optimised; the first pose is fixed.
PathGraph wandering(int poses, double side, std::uint64_t seed);
/// A chain of odometry along a straight line, a motion each.
PathGraph straight(int poses, const Pose2& motion);

/// A robot that has wandered about a square of 8 m, and knows what is around it.
PathGraph partly_explored(std::uint64_t seed);

/// The motions of a random walk from `at` that keeps to the square.
std::vector<Pose2> random_motions(Pose2 at, int count, double side, RandomNumbers& random);

/// What an estimator has after the poses and loop closures of a path were added to it.
struct FullInference {
  double trajectory_entropy = 0.0;  ///< change of (5.13), thesis' form
  Eigen::Matrix3d end;              ///< covariance of the last pose with the prior of the first
  std::vector<double> log_determinants;  ///< ln|Σ_ii| of all poses
};
FullInference infer(const PathGraph& graph, const PathInformation::State& path);

/// ln|Σ| of all poses but the first, jointly, by dense algebra.
double dense_log_determinant(Estimator& estimator, const std::vector<Id>& poses);

/// A copy of the graph's estimator with the poses and loop closures of a path, and its poses.
std::unique_ptr<Estimator> with_path(const PathGraph& graph, const PathInformation::State& path,
                                     std::vector<Id>& poses);

}  // namespace cairn::test
