// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/geometry/motion.hpp"

namespace cairn::test {

Eigen::MatrixXd covariance(const Motion& motion);

std::vector<double> numbers(const Eigen::MatrixXd& M);

/// ‖log(a⁻¹ b)‖
double distance(const MotionGroup& group, const std::vector<double>& a,
                const std::vector<double>& b);

/// Same mean and covariance, relative to their size.
void expect_same(const MotionGroup& group, const Motion& a, const Motion& b, double tolerance);

/// Random motions, the same everywhere.
class MotionSampler {
 public:
  explicit MotionSampler(unsigned seed) : rng_(seed) {}

  double uniform() { return static_cast<double>(rng_()) / 0x1p31 - 1.0; }
  Eigen::VectorXd vector(int n);
  Eigen::MatrixXd matrix(int rows, int columns);
  /// Positive definite, of standard deviations of about `sigma`.
  Eigen::MatrixXd positive(int n, double sigma);
  std::vector<double> state(const VariableType& type, double size = 1.0);
  Motion motion(const VariableType& type, double sigma = 0.1);

 private:
  std::mt19937 rng_;
};

/// The poses of space, or of the plane.
class MotionGroupTest : public testing::TestWithParam<bool> {
 protected:
  static std::shared_ptr<const VariableType> pose();
  /// ad(ξ) from the book.
  static Eigen::MatrixXd ad(const Eigen::VectorXd& xi);
  /// A motion that does nothing, uncertain by L Lᵀ.
  Motion at_rest(const Eigen::MatrixXd& L) const;

  MotionGroup group_{pose()};
  const VariableType& type_ = group_.type();
  const int n_ = group_.tangent_size();
  MotionSampler sampler_{5};
};

}  // namespace cairn::test
