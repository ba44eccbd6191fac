// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/block_matrix.hpp"

#include <gtest/gtest.h>

#include <Eigen/Sparse>

#include "support/block_systems.hpp"

namespace cairn {
namespace {

TEST(BlockStructure, SortsEntriesIntoTheLowerTriangleOnce) {
  const BlockStructure s({3, 2, 6}, {{0, 2}, {2, 0}, {1, 0}, {1, 1}});
  EXPECT_EQ(s.blocks(), 3);
  EXPECT_EQ(s.size(), 11);
  EXPECT_EQ(s.entries(), 5);
  EXPECT_EQ(s.values(), 9 + 6 + 18 + 4 + 36);
  EXPECT_EQ(s.find(0, 0), 0);
  EXPECT_EQ(s.find(1, 0), 1);
  EXPECT_EQ(s.find(2, 0), 2);
  EXPECT_EQ(s.find(2, 1), -1);
  EXPECT_NE(s.version(), BlockStructure({3}, {}).version());
}

TEST(BlockMatrix, MultipliesAsTheDenseMatrixDoes) {
  std::mt19937 rng(1);
  const BlockStructure s = test::random_structure(rng, 20, 30, {1, 2, 3, 6});
  BlockMatrix H(s);
  test::fill_positive_definite(rng, H);
  const Eigen::VectorXd x = Eigen::VectorXd::Random(s.size());
  Eigen::VectorXd y(s.size());
  H.multiply({x.data(), static_cast<std::size_t>(x.size())},
             {y.data(), static_cast<std::size_t>(y.size())});
  EXPECT_LT((y - test::dense(H) * x).norm(), 1e-12 * y.norm());
}

TEST(BlockMatrix, ReadsAndReplacesItsDiagonal) {
  std::mt19937 rng(1);
  const BlockStructure s = test::random_structure(rng, 6, 4, {2, 3});
  BlockMatrix H(s);
  test::fill_positive_definite(rng, H);
  const Eigen::MatrixXd before = test::dense(H);
  std::vector<double> diagonal(s.size());
  H.diagonal(diagonal);
  for (std::int64_t k = 0; k < s.size(); ++k) EXPECT_EQ(diagonal[k], before(k, k));
  for (double& d : diagonal) d += 1.0;
  H.set_diagonal(diagonal);
  EXPECT_LT((test::dense(H) - before - Eigen::MatrixXd::Identity(s.size(), s.size())).norm(),
            1e-12);
}

TEST(ScalarPattern, ScattersTheSameMatrixIntoEitherTriangle) {
  std::mt19937 rng(9);
  const BlockStructure s = test::random_structure(rng, 15, 12, {1, 3, 6});
  BlockMatrix H(s);
  test::fill_positive_definite(rng, H);
  const Eigen::MatrixXd D = test::dense(H);
  for (const auto triangle : {ScalarPattern::Triangle::lower, ScalarPattern::Triangle::upper}) {
    const ScalarPattern pattern(s, triangle);
    std::vector<double> values(pattern.nonzeros());
    pattern.scatter(H, values);
    ASSERT_EQ(pattern.size(), s.size());
    ASSERT_EQ(pattern.nonzeros(), pattern.column_begin().back());
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(s.size(), s.size());
    for (int column = 0; column < pattern.size(); ++column) {
      for (int k = pattern.column_begin()[column]; k < pattern.column_begin()[column + 1]; ++k) {
        const int row = pattern.rows()[k];
        if (k > pattern.column_begin()[column]) {
          EXPECT_GT(row, pattern.rows()[k - 1]);
        }
        sum(row, column) = values[k];
        sum(column, row) = values[k];
      }
    }
    EXPECT_EQ((sum - D).norm(), 0.0);
  }
}

}  // namespace
}  // namespace cairn
