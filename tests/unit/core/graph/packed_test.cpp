// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/packed.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "cairn/graph/rounding.hpp"
#include "support/sampling.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;

Eigen::MatrixXd random(test::Sampler& sampler, int rows, int columns) {
  Eigen::MatrixXd A(rows, columns);
  for (double& entry : A.reshaped()) entry = sampler.uniform(-1.0, 1.0);
  return A;
}

/// U of a packed root, with zeros below the diagonal.
Eigen::MatrixXd triangle(const std::vector<double>& packed, int n) {
  return unpack(packed, n).triangularView<Eigen::Upper>();
}

TEST(Packed, HoldsTheUpperTriangleRowByRow) {
  Eigen::Matrix3d A;
  A << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  EXPECT_EQ(packed_size(3), 6U);
  EXPECT_EQ(packed_size(0), 0U);
  EXPECT_THAT(pack(A), ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_EQ(unpack(pack(A), 3), A);
  EXPECT_EQ(unpack<3>(pack(A).data()), A);
}

TEST(SquareRoot, IsCholeskysFactorOfAPositiveDefiniteMatrix) {
  test::Sampler sampler(1);
  for (const int n : {1, 2, 3, 6, 9, 16, 20}) {
    const Eigen::MatrixXd B = random(sampler, n, n),
                          A = B.transpose() * B + 0.1 * Eigen::MatrixXd::Identity(n, n);
    std::vector<double> U(packed_size(n));
    ASSERT_TRUE(square_root(pack(A), n, U));
    const Eigen::MatrixXd expected = Eigen::LLT<Eigen::MatrixXd>(A).matrixU();
    EXPECT_LT((triangle(U, n) - expected).norm(), 1e-13) << n;
  }
}

TEST(SquareRoot, IsTriangularForEveryRankOfASemidefiniteMatrix) {
  test::Sampler sampler(2);
  for (const int n : {2, 3, 6, 9, 20}) {
    for (int rank = 0; rank < n; ++rank) {
      const Eigen::MatrixXd B = random(sampler, rank, n), A = B.transpose() * B;
      std::vector<double> U(packed_size(n));
      ASSERT_TRUE(square_root(pack(A), n, U)) << n << " " << rank;
      const Eigen::MatrixXd root = triangle(U, n);
      EXPECT_LT((root.transpose() * root - A).norm(), 1e-10 * (1.0 + A.norm())) << n << " " << rank;
      EXPECT_GE(root.diagonal().minCoeff(), 0.0);
    }
  }
}

TEST(SquareRoot, OfSmallEigenvaluesBesideZeroIsThatOfTheMatrix) {
  test::Sampler sampler(3);
  for (const int n : {3, 4, 6, 9}) {
    for (int zeros = 1; zeros < n - 1; ++zeros) {
      for (int k = 0; k < 50; ++k) {
        const Eigen::MatrixXd Q =
            Eigen::HouseholderQR<Eigen::MatrixXd>(random(sampler, n, n)).householderQ();
        Eigen::VectorXd values = Eigen::VectorXd::Ones(n);
        values.head(zeros).setZero();
        for (int i = zeros; i < n - 1; i += 2) values(i) = std::pow(10.0, -2.0 - k % 6);
        const Eigen::MatrixXd A = Q * values.asDiagonal() * Q.transpose();
        std::vector<double> U(packed_size(n));
        ASSERT_TRUE(square_root(pack(A), n, U)) << n << " " << zeros << " " << k;
        const Eigen::MatrixXd root = triangle(U, n);
        EXPECT_LT((root.transpose() * root - A).norm(), 1e-11) << n << " " << zeros << " " << k;
        EXPECT_EQ((root.diagonal().array() > 0.0).count(), n - zeros);
      }
    }
  }
}

TEST(SquareRoot, KeepsDirectionsThatAreNotMeasuredAtZero) {
  // Position without heading, in units nine orders of magnitude apart.
  std::vector<double> U(6);
  ASSERT_TRUE(square_root(std::vector<double>{4e8, 0, 0, 9e-1, 0, 0}, 3, U));
  EXPECT_THAT(U,
              ElementsAre(testing::DoubleEq(2e4), 0, 0, testing::DoubleEq(std::sqrt(0.9)), 0, 0));
}

TEST(SquareRoot, OfFloatsIsThatOfTheirRounding) {
  test::Sampler sampler(4);
  int only_by_rounding = 0;
  for (const int n : {2, 3, 6, 9}) {
    for (int k = 0; k < 50; ++k) {
      const Eigen::MatrixXd B = random(sampler, n - 1, n);
      Eigen::VectorXd units(n);
      for (double& unit : units) unit = std::pow(10.0, sampler.uniform(0.0, 3.0));
      const Eigen::MatrixXf root = (B * units.asDiagonal()).cast<float>();
      const Eigen::MatrixXd A = Eigen::MatrixXf(root.transpose() * root).cast<double>();
      std::vector<double> U(packed_size(n));
      ASSERT_TRUE(square_root(pack(A), n, U)) << n << " " << k;
      const Eigen::MatrixXd kept = triangle(U, n).transpose() * triangle(U, n);
      const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseInverse();
      EXPECT_LT((scale.asDiagonal() * (kept - A) * scale.asDiagonal()).norm(), 1e-5);
      only_by_rounding += !square_root_of_doubles(pack(A), n, U);
    }
  }
  EXPECT_GT(only_by_rounding, 50);
}

TEST(SquareRoot, OfFloatsIsRefusedWhereTheyAreIndefinite) {
  std::vector<double> U(3);
  for (const double corner : {0.999, 1.0 - 1e-5, -1e-5, -1e-3}) {
    const std::vector<double> A{1.0, corner < 0.0 ? 0.0 : 1.0, double(float(corner))};
    EXPECT_FALSE(square_root(A, 2, U)) << corner;
  }
  // Not of floats: as near as doubles are.
  EXPECT_FALSE(square_root(std::vector<double>{1.0, 1.0, 1.0 - 5e-8 + 1e-15}, 2, U));
  EXPECT_TRUE(square_root(std::vector<double>{1.0, 1.0, 1.0 - 0x1p-24}, 2, U));
}

TEST(SquareRoot, IsInPlaceToo) {
  std::vector<double> A{4, 2, 5};
  ASSERT_TRUE(square_root(A, 2, A));
  EXPECT_THAT(A, ElementsAre(2, 1, 2));
}

TEST(SquareRoot, RefusesWhatHasNone) {
  std::vector<double> U(3);
  EXPECT_FALSE(square_root(std::vector<double>{1, 2, 1}, 2, U));  // eigenvalues 3 and −1
  EXPECT_FALSE(square_root(std::vector<double>{1, 0, -1}, 2, U));
  EXPECT_FALSE(square_root(std::vector<double>{0, 1, 5}, 2, U));
  EXPECT_FALSE(square_root(std::vector<double>{1, 1.0 + 1e-6, 1}, 2, U));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(square_root(std::vector<double>{1, nan, 1}, 2, U));
  EXPECT_FALSE(
      square_root(std::vector<double>{1, 0, std::numeric_limits<double>::infinity()}, 2, U));
}

}  // namespace
}  // namespace cairn
