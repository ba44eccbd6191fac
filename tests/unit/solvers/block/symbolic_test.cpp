// SPDX-License-Identifier: BSD-3-Clause
#include "block/symbolic.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "block/ordering.hpp"
#include "support/block_systems.hpp"

namespace cairn::block {
namespace {

/// Scalar column counts of the Cholesky factor by dense symbolic elimination.
std::vector<std::int64_t> column_counts(const BlockStructure& structure,
                                        std::span<const std::int32_t> order) {
  const std::int64_t n = structure.size();
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> pattern =
      Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>::Zero(n, n);
  std::vector<std::int64_t> place(structure.blocks());
  std::int64_t next = 0;
  for (const std::int32_t block : order) {
    place[block] = next;
    next += structure.block_size(block);
  }
  for (int j = 0; j < structure.blocks(); ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
      const int i = structure.rows()[e];
      pattern.block(place[i], place[j], structure.block_size(i), structure.block_size(j))
          .setConstant(true);
      pattern.block(place[j], place[i], structure.block_size(j), structure.block_size(i))
          .setConstant(true);
    }
  }
  std::vector<std::int64_t> counts(n, 0);
  for (std::int64_t k = 0; k < n; ++k) {
    for (std::int64_t i = k; i < n; ++i) {
      if (!pattern(i, k)) continue;
      ++counts[k];
      for (std::int64_t j = k; j < n; ++j) {
        if (pattern(j, k)) pattern(i, j) = true;
      }
    }
  }
  return counts;
}

TEST(Symbolic, CountsNonzerosAndFlopsAsDenseEliminationDoes) {
  std::mt19937 rng(2);
  for (int trial = 0; trial < 10; ++trial) {
    const BlockStructure structure = test::random_structure(rng, 25, 15, {2, 3});
    const std::vector<std::int32_t> ordering = order(structure, "amd");
    const Symbolic symbolic(structure, ordering);
    std::int64_t nonzeros = 0;
    double flops = 0.0;
    for (const std::int64_t count : column_counts(structure, ordering)) {
      nonzeros += count;
      flops += static_cast<double>(count * count);
    }
    EXPECT_EQ(symbolic.factor_nonzeros, nonzeros);
    EXPECT_EQ(symbolic.factor_flops, flops);
  }
}

TEST(Symbolic, OrdersEveryBlockOnceAndParentsAfterChildren) {
  std::mt19937 rng(4);
  const BlockStructure structure = test::random_structure(rng, 200, 80, {3});
  const Symbolic symbolic(structure, order(structure, "amd"));
  std::vector<bool> seen(200, false);
  for (int k = 0; k < 200; ++k) {
    const std::int32_t block = symbolic.order()[k];
    EXPECT_FALSE(seen[block]);
    seen[block] = true;
    EXPECT_EQ(symbolic.position()[block], k);
  }
  std::int32_t expected_begin = 0;
  for (std::size_t s = 0; s < symbolic.supernodes().size(); ++s) {
    const Supernode& node = symbolic.supernodes()[s];
    EXPECT_EQ(node.block_begin, expected_begin);
    expected_begin = node.block_end;
    if (node.parent >= 0) {
      EXPECT_GT(node.parent, static_cast<std::int32_t>(s));
      const Supernode& parent = symbolic.supernodes()[node.parent];
      const std::int32_t first_row = symbolic.rows()[node.rows_begin];
      EXPECT_GE(first_row, parent.block_begin);
      EXPECT_LT(first_row, parent.block_end);
    } else {
      EXPECT_EQ(node.rows_begin, node.rows_end);
    }
  }
  EXPECT_EQ(expected_begin, 200);
}

}  // namespace
}  // namespace cairn::block
