// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/exploration/exploration.hpp"
#include "cairn/typed/build.hpp"

namespace cairn {
namespace {

/// Odometry around a loop, and a loop closure.
GraphUpdate loop(bool fixed, const Eigen::Vector3d& first_sigma) {
  GraphUpdate update;
  constexpr int kPoses = 8;
  Pose2 at(1.0, -2.0, 0.4);
  Variable first = make_variable(0, at);
  first.fixed = fixed;
  update.variables.push_back(first);
  if (!fixed) {
    update.factors.push_back(make_factor(
        Prior(0, at), Information::sigmas(first_sigma.x(), first_sigma.y(), first_sigma.z())));
  }
  const Pose2 motion(1.0, 0.1, 2.0 * std::numbers::pi / kPoses);
  for (Id id = 1; id < kPoses; ++id) {
    at = at * motion;
    update.variables.push_back(make_variable(id, at));
    update.factors.push_back(
        make_factor(Between(id - 1, id, motion), Information::sigmas(0.1, 0.05, 0.02)));
  }
  update.factors.push_back(
      make_factor(Between(kPoses - 1, 0, motion), Information::sigmas(0.05, 0.05, 0.01)));
  return update;
}

/// A first pose that is fixed and moves as a whole with its prior, beside a graph that has it.
TEST(TrajectoryEntropy, IsThatOfAGraphWithAPriorOnTheFirstPose) {
  Registry& registry = default_registry();
  if (!registry.has("estimator", "incremental_cholesky")) GTEST_SKIP() << "without the estimator";
  const Eigen::Vector3d sigma(0.05, 0.03, 0.0017);
  const auto fixed = registry.make<Estimator>("incremental_cholesky");
  fixed->update(loop(true, sigma));
  const auto with_prior = registry.make<Estimator>("incremental_cholesky");
  with_prior->update(loop(false, sigma));
  const std::vector<Id> poses = fixed->variables();
  double expected = 0.0;
  for (const Id id : poses) {
    Eigen::Matrix3d block;
    ASSERT_TRUE(with_prior->covariance(id, id, {block.data(), 9}));
    expected +=
        1.5 * std::log(2.0 * std::numbers::pi * std::numbers::e) + std::log(block.determinant());
  }
  expected /= static_cast<double>(poses.size());
  EXPECT_NEAR(trajectory_entropy(*fixed, poses, sigma), expected, 1e-6);
  EXPECT_TRUE(std::isnan(trajectory_entropy(*fixed, {}, sigma)));
}

}  // namespace
}  // namespace cairn
