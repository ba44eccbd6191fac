// SPDX-License-Identifier: BSD-3-Clause
#include "relocation.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <Eigen/LU>

#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;

/// What the header says, with determinants.
double lost(double w, const MatrixXd& way, const MatrixXd& match) {
  const auto n = static_cast<double>(way.rows());
  return 0.5 * std::log((way + match / w).determinant() / (way + match).determinant()) -
         0.5 * n * std::log1p(-w);
}

MatrixXd any_covariance(test::Draw& draw, int n) {
  MatrixXd root(n, n);
  for (double& x : root.reshaped()) x = draw.uniform(-1.0, 1.0);
  return root * root.transpose() + 0.01 * MatrixXd::Identity(n, n);
}

TEST(PartOfWay, LosesLeastOfAllDivisions) {
  test::Draw draw(7);
  for (const int n : {3, 6}) {
    for (int trial = 0; trial < 50; ++trial) {
      const MatrixXd way = std::pow(10.0, draw.uniform(-4.0, 4.0)) * any_covariance(draw, n),
                     match = any_covariance(draw, n);
      const double least = lost(part_of_way(way, match), way, match);
      for (double w = 0.001; w < 1.0; w += 0.001)
        EXPECT_LE(least, lost(w, way, match) + 1e-9 * n) << w;
    }
  }
}

TEST(PartOfWay, IsInHalvesWhereTheWayIsKnownExactly) {
  EXPECT_NEAR(part_of_way(MatrixXd::Zero(3, 3), MatrixXd::Identity(3, 3)), 0.5, 1e-12);
}

/// λ = 1 in every direction: w² + 2 w = 1.
TEST(PartOfWay, IsKnownWhereTheWayIsAsUncertainAsTheMatch) {
  const MatrixXd same = 0.3 * MatrixXd::Identity(6, 6);
  EXPECT_NEAR(part_of_way(same, same), std::sqrt(2.0) - 1.0, 1e-12);
}

TEST(PartOfWay, GivesLittleToAVeryUncertainWay) {
  const MatrixXd way = 1e8 * MatrixXd::Identity(3, 3), match = MatrixXd::Identity(3, 3);
  const double w = part_of_way(way, match);
  EXPECT_NEAR(w, 1e-4, 1e-6);
  EXPECT_LT(lost(w, way, match), 1e-3);
}

}  // namespace
}  // namespace cairn::compact
