// SPDX-License-Identifier: BSD-3-Clause
#include "block/supernodal_cholesky.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

#include <Eigen/Dense>

#include "block/ordering.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/block_systems.hpp"
#include "support/kernel_sets.hpp"

namespace cairn::block {
namespace {

using test::dense;
using test::fill_positive_definite;
using test::kernel_sets;
using test::random_structure;

std::vector<std::string> orderings() {
  std::vector<std::string> names = ordering_names();
  names.emplace_back("auto");
  return names;
}

Eigen::VectorXd solve(SupernodalCholesky& cholesky, const Eigen::VectorXd& g) {
  Eigen::VectorXd x(g.size());
  cholesky.solve({g.data(), static_cast<std::size_t>(g.size())},
                 {x.data(), static_cast<std::size_t>(x.size())});
  return x;
}

TEST(SupernodalCholesky, AgreesWithDenseAlgebraForEveryKernelSetAndBlockSize) {
  std::mt19937 rng(7);
  const std::vector<std::vector<std::int32_t>> mixes = {{3},    {6}, {2, 3},
                                                        {3, 6}, {1}, {1, 2, 3, 6, 7, 9}};
  for (int trial = 0; trial < 60; ++trial) {
    const int blocks = 1 + static_cast<int>(rng() % 50);
    const BlockStructure structure = random_structure(
        rng, blocks, static_cast<int>(rng() % (2 * blocks)), mixes[trial % mixes.size()]);
    BlockMatrix H(structure);
    fill_positive_definite(rng, H);
    const Eigen::MatrixXd D = dense(H);
    const Eigen::LDLT<Eigen::MatrixXd> oracle(D);
    const Eigen::VectorXd g = Eigen::VectorXd::Random(D.rows());
    const Eigen::VectorXd expected = oracle.solve(g);
    const double log_determinant = oracle.vectorD().array().log().sum();
    for (const std::string& kernels : kernel_sets()) {
      for (const std::string& ordering : orderings()) {
        SupernodalCholesky cholesky(kernels);
        cholesky.analyze(structure, ordering);
        ASSERT_TRUE(cholesky.factorize(H).ok);
        EXPECT_LT((solve(cholesky, g) - expected).norm(), 1e-12 * expected.norm())
            << kernels << ' ' << ordering << ' ' << trial;
        EXPECT_NEAR(cholesky.log_determinant(), log_determinant,
                    1e-12 * std::abs(log_determinant) + 1e-12);
      }
    }
  }
}

TEST(SupernodalCholesky, MergesSupernodesWithoutChangingTheResult) {
  std::mt19937 rng(11);
  const BlockStructure structure = random_structure(rng, 120, 100, {3});
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  const CostModel never{.supernode = 0.0,
                        .panel_entry = 1.0,
                        .panel_flop = 1.0,
                        .update_flop = 1.0,
                        .extend_entry = 0.0};
  const CostModel always{.supernode = 1e9};
  SupernodalCholesky fine, coarse;
  fine.analyze(structure, "amd", never);
  coarse.analyze(structure, "amd", always);
  ASSERT_EQ(coarse.symbolic().supernodes().size(), 1U);
  ASSERT_GT(fine.symbolic().supernodes().size(), 10U);
  ASSERT_TRUE(fine.factorize(H).ok);
  ASSERT_TRUE(coarse.factorize(H).ok);
  EXPECT_LT((solve(fine, g) - solve(coarse, g)).norm(), 1e-13 * g.norm());
}

/// A grid whose last row of blocks is joined with everything: a tree with one wide front on top.
BlockStructure grid_with_a_dense_edge(int side, int block_size) {
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (int r = 0; r < side; ++r) {
    for (int c = 0; c < side; ++c) {
      const int here = r * side + c;
      if (c > 0) entries.emplace_back(here, here - 1);
      if (r > 0) entries.emplace_back(here, here - side);
      for (int last = 0; last < side; ++last) {
        const int edge = (side - 1) * side + last;
        if (edge > here && (last % 3 == c % 3 || r == side - 1)) entries.emplace_back(edge, here);
      }
    }
  }
  return BlockStructure(std::vector<std::int32_t>(side * side, block_size), entries);
}

TEST(SupernodalCholesky, GivesTheSameBitsForAnyNumberOfThreads) {
  std::mt19937 rng(3);
  const BlockStructure structure = grid_with_a_dense_edge(22, 6);
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  const int before = threads();
  std::vector<Eigen::VectorXd> results;
  std::optional<double> log_determinant;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    SupernodalCholesky cholesky;
    cholesky.analyze(structure, "amd");
    ASSERT_TRUE(cholesky.factorize(H).ok);
    results.push_back(solve(cholesky, g));
    EXPECT_EQ(cholesky.log_determinant(), log_determinant.value_or(cholesky.log_determinant()));
    log_determinant = cholesky.log_determinant();
  }
  set_threads(before);
  EXPECT_TRUE((results[0].array() == results[1].array()).all());
  EXPECT_TRUE((results[0].array() == results[2].array()).all());
}

TEST(SupernodalCholesky, FactorsWideFrontsForEveryKernelSet) {
  std::mt19937 rng(21);
  const BlockStructure structure = grid_with_a_dense_edge(17, 7);
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::LDLT<Eigen::MatrixXd> oracle(dense(H));
  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  const Eigen::VectorXd expected = oracle.solve(g);
  for (const std::string& kernels : kernel_sets()) {
    SupernodalCholesky cholesky(kernels);
    cholesky.analyze(structure, "natural", {.supernode = 1e6});
    ASSERT_TRUE(cholesky.factorize(H).ok);
    EXPECT_LT((solve(cholesky, g) - expected).norm(), 1e-12 * expected.norm()) << kernels;
  }
}

Eigen::VectorXd solve_single(SupernodalCholesky& cholesky, const Eigen::VectorXd& g) {
  Eigen::VectorXd x(g.size());
  cholesky.solve_single({g.data(), static_cast<std::size_t>(g.size())},
                        {x.data(), static_cast<std::size_t>(x.size())});
  return x;
}

TEST(SupernodalCholesky, FactorsInSinglePrecisionForEveryKernelSetAndBlockSize) {
  std::mt19937 rng(27);
  const std::vector<std::vector<std::int32_t>> mixes = {{3}, {6}, {3, 6}, {1}, {1, 2, 3, 6, 7, 9}};
  for (int trial = 0; trial < 40; ++trial) {
    const int blocks = 1 + static_cast<int>(rng() % 50);
    const BlockStructure structure = random_structure(
        rng, blocks, static_cast<int>(rng() % (2 * blocks)), mixes[trial % mixes.size()]);
    BlockMatrix H(structure);
    fill_positive_definite(rng, H);
    const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
    const Eigen::VectorXd expected = Eigen::LDLT<Eigen::MatrixXd>(dense(H)).solve(g);
    for (const std::string& kernels : kernel_sets()) {
      for (const std::string& ordering : orderings()) {
        SupernodalCholesky cholesky(kernels);
        cholesky.analyze(structure, ordering);
        ASSERT_TRUE(cholesky.factorize_single(H).ok);
        // Diagonally dominant: rounding to single precision is all there is.
        EXPECT_LT((solve_single(cholesky, g) - expected).norm(), 2e-6 * expected.norm())
            << kernels << ' ' << ordering << ' ' << trial;
        EXPECT_THROW(solve(cholesky, g), std::logic_error);
        EXPECT_THROW(cholesky.log_determinant(), std::logic_error);
        ASSERT_TRUE(cholesky.factorize(H).ok);
        EXPECT_LT((solve(cholesky, g) - expected).norm(), 1e-12 * expected.norm());
        EXPECT_THROW(solve_single(cholesky, g), std::logic_error);
      }
    }
  }
}

TEST(SupernodalCholesky, FactorsWideFrontsInSinglePrecisionForEveryKernelSet) {
  std::mt19937 rng(28);
  for (const int size : {3, 6, 7}) {
    const BlockStructure structure = grid_with_a_dense_edge(17, size);
    BlockMatrix H(structure);
    fill_positive_definite(rng, H);
    const Eigen::VectorXd expected = Eigen::VectorXd::Random(structure.size());
    const Eigen::VectorXd g = dense(H) * expected;
    for (const std::string& kernels : kernel_sets()) {
      for (const double supernode : {120.0, 1e6}) {
        SupernodalCholesky cholesky(kernels);
        cholesky.analyze(structure, "natural", {.supernode = supernode});
        ASSERT_TRUE(cholesky.factorize_single(H).ok);
        EXPECT_LT((solve_single(cholesky, g) - expected).norm(), 2e-6 * expected.norm())
            << kernels << ' ' << size << ' ' << supernode;
      }
    }
  }
}

TEST(SupernodalCholesky, NamesTheBlockThatIsNotPositiveInAWideFront) {
  std::mt19937 rng(22);
  const BlockStructure structure = grid_with_a_dense_edge(15, 6);
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const int bad = structure.blocks() - 4;
  H.block(structure.column_begin()[bad])[0] = -1e6;
  for (const int count : {1, 2}) {
    const int before = threads();
    set_threads(count);
    SupernodalCholesky cholesky;
    cholesky.analyze(structure, "natural");
    EXPECT_EQ(cholesky.factorize(H).failed_block, bad);
    EXPECT_EQ(cholesky.factorize_single(H).failed_block, bad);
    set_threads(before);
  }
}

TEST(SupernodalCholesky, SolvesForManyRightHandSides) {
  std::mt19937 rng(23);
  const BlockStructure structure = random_structure(rng, 150, 130, {2, 3, 6});
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::LDLT<Eigen::MatrixXd> oracle(dense(H));
  for (const std::string& kernels : kernel_sets()) {
    SupernodalCholesky cholesky(kernels);
    cholesky.analyze(structure, "amd");
    ASSERT_TRUE(cholesky.factorize(H).ok);
    cholesky.solve({}, {}, 0);
    for (const int columns : {1, 7, 8, 19}) {
      Eigen::MatrixXd X = Eigen::MatrixXd::Random(structure.size(), columns);
      const Eigen::MatrixXd expected = oracle.solve(X);
      const std::span<double> values(X.data(), static_cast<std::size_t>(X.size()));
      cholesky.solve(values, values, columns);
      EXPECT_LE((X - expected).norm(), 1e-12 * expected.norm()) << kernels << ' ' << columns;
    }
    // And one again, in the room that the eight have left.
    const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
    const Eigen::VectorXd expected = oracle.solve(g);
    EXPECT_LT((solve(cholesky, g) - expected).norm(), 1e-12 * expected.norm());
    std::vector<double> wrong(structure.size() + 1);
    EXPECT_THROW(cholesky.solve(wrong, wrong, 1), std::logic_error);
  }
}

TEST(SupernodalCholesky, KeepsTheStackOfUpdateMatricesSmall) {
  const int side = 60;
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (int k = 0; k < side * side; ++k) {
    if (k % side > 0) entries.emplace_back(k, k - 1);
    if (k >= side) entries.emplace_back(k, k - side);
  }
  const BlockStructure structure(std::vector<std::int32_t>(side * side, 3), entries);
  const int before = threads();
  set_threads(1);
  SupernodalCholesky cholesky;
  cholesky.analyze(structure, "amd");
  set_threads(before);
  EXPECT_LT(cholesky.numbers(), 3 * cholesky.symbolic().factor_nonzeros);
}

TEST(SupernodalCholesky, NamesABlockThatIsNotPositiveAndRecovers) {
  std::mt19937 rng(5);
  const BlockStructure structure = random_structure(rng, 40, 30, {3, 6});
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const std::vector<double> good(H.values().begin(), H.values().end());
  SupernodalCholesky cholesky;
  cholesky.analyze(structure, "natural");
  for (const int bad : {0, 17, 39}) {
    std::ranges::copy(good, H.values().begin());
    H.block(structure.column_begin()[bad])[0] = -1e6;
    const Factorization failed = cholesky.factorize(H);
    EXPECT_FALSE(failed.ok);
    EXPECT_EQ(failed.failed_block, bad);
    std::vector<double> x(structure.size());
    EXPECT_THROW(cholesky.solve(x, x), std::logic_error);
  }
  std::ranges::copy(good, H.values().begin());
  EXPECT_TRUE(cholesky.factorize(H).ok);
  H.block(structure.column_begin()[3])[0] = std::nan("");
  EXPECT_FALSE(cholesky.factorize(H).ok);
}

TEST(SupernodalCholesky, UsesTheOrderingThatIsChosenForTheStructure) {
  // One is cheap, the other so dear that dissection is tried.
  for (const int side : {5, 13}) {
    const BlockStructure structure = test::solid_grid(side, 6);
    const Choice choice = choose(structure);
    SupernodalCholesky chosen, amd;
    chosen.analyze(structure, "auto");
    amd.analyze(structure, "amd");
    EXPECT_EQ(chosen.ordering(), choice.name);
    EXPECT_EQ(chosen.symbolic().factor_flops, factor_flops(structure, choice.order));
    EXPECT_LE(chosen.symbolic().factor_flops, amd.symbolic().factor_flops);
  }
}

TEST(SupernodalCholesky, RefusesKernelsThatItDoesNotHave) {
  EXPECT_THROW(SupernodalCholesky("mmx"), Error);
}

TEST(SupernodalCholesky, TakesAnEmptySystem) {
  const BlockStructure structure({}, {});
  const BlockMatrix H(structure);
  SupernodalCholesky cholesky;
  cholesky.analyze(structure, "amd");
  EXPECT_TRUE(cholesky.factorize(H).ok);
  EXPECT_EQ(cholesky.log_determinant(), 0.0);
}

}  // namespace
}  // namespace cairn::block
