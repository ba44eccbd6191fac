// SPDX-License-Identifier: BSD-3-Clause
#include "block/chain_cholesky.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "cairn/runtime/threads.hpp"
#include "support/block_systems.hpp"
#include "support/kernel_sets.hpp"

namespace cairn::block {
namespace {

using test::dense;
using test::kernel_sets;

using Pairs = std::vector<std::pair<std::int32_t, std::int32_t>>;

/// A path with a few loops, its blocks numbered at random; every so often a block of another size
/// hangs on it, an end is free, and loops meet in one block.
BlockStructure sparse_graph(std::mt19937& rng, int blocks, int loops, std::int32_t size,
                            bool shuffled, int others = 0) {
  std::vector<std::int32_t> name(blocks);
  for (int k = 0; k < blocks; ++k) name[k] = k;
  if (shuffled) std::ranges::shuffle(name, rng);
  Pairs entries;
  for (int k = 1; k < blocks; ++k) entries.emplace_back(name[k - 1], name[k]);
  for (int k = 0; k < loops; ++k) entries.emplace_back(name[rng() % blocks], name[rng() % blocks]);
  std::vector<std::int32_t> sizes(blocks, size);
  for (int k = 0; k < others; ++k) {
    entries.emplace_back(static_cast<std::int32_t>(sizes.size()), name[rng() % blocks]);
    sizes.push_back(2);
  }
  return BlockStructure(std::move(sizes), std::move(entries));
}

/// A ring of blocks with nothing else on it, twice, and a path by itself.
BlockStructure rings(int blocks) {
  Pairs entries;
  for (int k = 0; k < blocks; ++k) {
    entries.emplace_back(k, (k + 1) % blocks);
    entries.emplace_back(blocks + k, blocks + (k + 1) % blocks);
    if (k > 0) entries.emplace_back(2 * blocks + k - 1, 2 * blocks + k);
  }
  return BlockStructure(std::vector<std::int32_t>(3 * blocks, 3), std::move(entries));
}

std::vector<double> solved(ChainCholesky& cholesky, const Eigen::VectorXd& g) {
  std::vector<double> x(g.data(), g.data() + g.size());
  cholesky.solve(x, x);
  return x;
}

void expect_dense(const BlockStructure& structure, const std::string& kernels, std::mt19937& rng) {
  BlockMatrix H(structure);
  test::fill_positive_definite(rng, H);
  const Eigen::LDLT<Eigen::MatrixXd> oracle(dense(H));
  const Eigen::MatrixXd Z =
      oracle.solve(Eigen::MatrixXd::Identity(structure.size(), structure.size()));
  ChainCholesky cholesky(kernels);
  cholesky.analyze(structure, "auto");
  ASSERT_FALSE(cholesky.chains().empty());
  ASSERT_TRUE(cholesky.factorize(H).ok);

  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  const Eigen::VectorXd expected = oracle.solve(g);
  const std::vector<double> x = solved(cholesky, g);
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(x.data(), g.size()) - expected).norm(),
            1e-12 * expected.norm());
  const double log_determinant = oracle.vectorD().array().log().sum();
  EXPECT_NEAR(cholesky.log_determinant(), log_determinant, 1e-12 * std::abs(log_determinant));

  // More than are solved for together, over themselves.
  Eigen::MatrixXd X = Eigen::MatrixXd::Random(structure.size(), 19);
  const Eigen::MatrixXd all_right = oracle.solve(X);
  const std::span<double> numbers(X.data(), static_cast<std::size_t>(X.size()));
  cholesky.solve(numbers, numbers, static_cast<int>(X.cols()));
  for (Eigen::Index c = 0; c < X.cols(); ++c)
    EXPECT_LT((X.col(c) - all_right.col(c)).norm(), 1e-12 * all_right.col(c).norm()) << c;

  const std::vector<std::int64_t> scalars{0, structure.size() / 2, structure.size() - 1};
  std::vector<double> columns(3 * structure.size());
  cholesky.inverse_columns(scalars, columns);
  for (std::size_t c = 0; c < scalars.size(); ++c) {
    const Eigen::Map<const Eigen::VectorXd> column(columns.data() + c * structure.size(),
                                                   structure.size());
    EXPECT_LT((column - Z.col(scalars[c])).norm(), 1e-10 * Z.col(scalars[c]).norm());
  }

  ChainInverse inverse(cholesky);
  inverse.compute();
  std::size_t used = 0;
  for (const std::int32_t size : structure.sizes()) used += size * size;
  std::vector<double> diagonal(used);
  inverse.diagonal_blocks(diagonal);
  const double* own = diagonal.data();
  const double scale = Z.norm();
  for (int i = 0; i < structure.blocks(); ++i) {
    for (int j = 0; j < structure.blocks(); ++j) {
      const int rows = structure.block_size(i), cols = structure.block_size(j);
      Eigen::MatrixXd block(rows, cols);
      const bool has = inverse.block(i, j, block.data());
      EXPECT_TRUE(has || (i != j && structure.find(std::max(i, j), std::min(i, j)) < 0));
      if (!has) continue;
      const auto right = Z.block(structure.offsets()[i], structure.offsets()[j], rows, cols);
      EXPECT_LE((block - right).norm(), 1e-10 * scale) << i << ' ' << j;
      if (i != j) continue;
      EXPECT_TRUE(block == block.transpose() &&
                  block == Eigen::Map<const Eigen::MatrixXd>(own, rows, cols));
      own += block.size();
    }
  }
}

TEST(ChainCholesky, AgreesWithDenseAlgebraForEveryKernelSetAndBothSizes) {
  std::mt19937 rng(3);
  for (const std::string& kernels : kernel_sets()) {
    for (const std::int32_t size : {3, 6}) {
      for (const bool shuffled : {false, true}) {
        expect_dense(sparse_graph(rng, 190, 9, size, shuffled), kernels, rng);
        expect_dense(sparse_graph(rng, 180, 8, size, shuffled, 10), kernels, rng);
      }
    }
    expect_dense(sparse_graph(rng, 150, 0, 3, true), kernels, rng);
    expect_dense(rings(50), kernels, rng);
  }
}

TEST(ChainCholesky, CutsPathsIntoChainsThatMeetInSeparatorsOnly) {
  std::mt19937 rng(8);
  for (const int loops : {0, 3, 40}) {
    const BlockStructure s = sparse_graph(rng, 600, loops, 3, loops == 3);
    const Chains chains(s, 8);
    ASSERT_FALSE(chains.empty());
    std::vector<int> seen(s.blocks(), 0);
    std::vector<std::int32_t> chain_of(s.blocks(), -1);
    for (std::size_t c = 0; c < chains.chains().size(); ++c) {
      const Chains::Chain& chain = chains.chains()[c];
      EXPECT_TRUE(chain.first < 0 || chain.first != chain.last);
      for (const std::int32_t node : chain.nodes(chains)) {
        ++seen[node];
        chain_of[node] = static_cast<std::int32_t>(c);
      }
      const ChainGroup group = chains.group(chain.group);
      EXPECT_EQ(group.length, static_cast<int>(chain.length));
      for (std::size_t k = 0; k < chain.length; ++k)
        EXPECT_EQ(group.row[k * 8 + chain.lane], s.offsets()[chain.nodes(chains)[k]]);
    }
    for (const std::int32_t b : chains.separators()) ++seen[b];
    EXPECT_TRUE(std::ranges::all_of(seen, [](int times) { return times == 1; }));
    for (std::int32_t j = 0; j < s.blocks(); ++j) {
      for (std::int64_t e = s.column_begin()[j]; e < s.column_begin()[j + 1]; ++e) {
        const std::int32_t a = chain_of[j], b = chain_of[s.rows()[e]];
        EXPECT_TRUE(a < 0 || b < 0 || a == b);
      }
    }
  }
}

TEST(ChainCholesky, CopiesEveryEntryBetweenSeparatorsOnceInRisingOrder) {
  std::mt19937 rng(7);
  const BlockStructure structure = sparse_graph(rng, 300, 80, 3, true, 10);
  const Chains chains(structure, 4);
  ASSERT_FALSE(chains.empty());
  // By number of `rest`, the one of H; -1 where only chains contribute.
  std::vector<std::int64_t> source(chains.rest().values(), -1);
  std::int64_t end = 0, copied = 0;
  for (const Chains::Copy& copy : chains.copies()) {
    EXPECT_GE(copy.target, end);
    end = copy.target + copy.size;
    ASSERT_LE(end, chains.rest().values());
    for (std::int64_t k = 0; k < copy.size; ++k) source[copy.target + k] = copy.source + k;
  }
  for (std::int32_t j = 0; j < structure.blocks(); ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
      const std::int32_t row = chains.place_in_rest()[structure.rows()[e]],
                         column = chains.place_in_rest()[j];
      if (row < 0 || column < 0) continue;
      const std::int64_t begin = structure.value_begin()[e],
                         to = chains.rest().value_begin()[chains.rest().find(row, column)];
      for (std::int64_t k = 0; k < structure.value_begin()[e + 1] - begin; ++k, ++copied)
        EXPECT_EQ(source[to + k], begin + k);
    }
  }
  EXPECT_EQ(std::ranges::count_if(source, [](std::int64_t s) { return s >= 0; }), copied);
  EXPECT_LT(copied, chains.rest().values());  // or nothing is left for chains alone
}

TEST(ChainCholesky, EliminatesEveryBlockOnceAndCountsWhatADenseFactorHas) {
  std::mt19937 rng(5);
  const BlockStructure s = sparse_graph(rng, 200, 12, 3, true);
  BlockMatrix H(s);
  test::fill_positive_definite(rng, H);
  ChainCholesky cholesky;
  cholesky.analyze(s, "auto");
  std::vector<std::int32_t> order(cholesky.order().begin(), cholesky.order().end());
  Eigen::MatrixXd permuted(s.size(), s.size());
  const Eigen::MatrixXd D = dense(H);
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = 0; j < order.size(); ++j)
      permuted.block<3, 3>(3 * i, 3 * j) =
          D.block<3, 3>(s.offsets()[order[i]], s.offsets()[order[j]]);
  }
  std::ranges::sort(order);
  for (int k = 0; k < s.blocks(); ++k) EXPECT_EQ(order[k], k);
  const Eigen::MatrixXd L = Eigen::LLT<Eigen::MatrixXd>(permuted).matrixL();
  std::int64_t nonzeros = 0;
  double flops = 0.0;
  for (int c = 0; c < L.cols(); ++c) {
    const auto count = static_cast<double>((L.col(c).array().abs() > 0.0).count());
    nonzeros += static_cast<std::int64_t>(count);
    flops += count * count;
  }
  EXPECT_EQ(cholesky.factor_nonzeros(), nonzeros);
  EXPECT_EQ(cholesky.factor_flops(), flops);
}

TEST(ChainCholesky, NamesTheBlockAtWhichTheMatrixStopsBeingPositiveDefinite) {
  std::mt19937 rng(6);
  const BlockStructure s = sparse_graph(rng, 200, 5, 3, false);
  ChainCholesky cholesky;
  cholesky.analyze(s, "auto");
  for (const double bad : {-1e6, 0.0, std::nan(""), HUGE_VAL}) {
    for (const std::int32_t block :
         {cholesky.order().front(), cholesky.order()[40], cholesky.order().back()}) {
      BlockMatrix H(s);
      test::fill_positive_definite(rng, H);
      ASSERT_TRUE(cholesky.factorize(H).ok);
      double* diagonal = H.block(s.column_begin()[block]);
      for (int k = 0; k < 9; ++k) diagonal[k] = k % 4 == 0 ? bad : 0.0;
      const Factorization failed = cholesky.factorize(H);
      EXPECT_FALSE(failed.ok) << bad;
      EXPECT_EQ(failed.failed_block, block) << bad;
      std::vector<double> x(s.size(), 1.0);
      EXPECT_THROW(cholesky.solve(x, x), std::logic_error);
      EXPECT_THROW(cholesky.log_determinant(), std::logic_error);
    }
  }
}

TEST(ChainCholesky, GivesTheSameBitsForAnyNumberOfThreads) {
  std::mt19937 rng(9);
  const BlockStructure s = sparse_graph(rng, 5000, 300, 3, false);
  BlockMatrix H(s);
  test::fill_positive_definite(rng, H);
  const Eigen::VectorXd g = Eigen::VectorXd::Random(s.size());
  const int before = threads();
  std::vector<std::vector<double>> x, diagonals;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    ChainCholesky cholesky;
    cholesky.analyze(s, "auto");
    ASSERT_TRUE(cholesky.factorize(H).ok);
    x.push_back(solved(cholesky, g));
    ChainInverse inverse(cholesky);
    inverse.compute();
    inverse.diagonal_blocks(diagonals.emplace_back(9 * s.blocks()));
  }
  set_threads(before);
  EXPECT_EQ(x[0], x[1]);
  EXPECT_EQ(x[0], x[2]);
  EXPECT_EQ(diagonals[0], diagonals[1]);
  EXPECT_EQ(diagonals[0], diagonals[2]);
}

TEST(ChainCholesky, IsSupernodalAloneWhereChainsAreFew) {
  std::mt19937 rng(10);
  ChainCholesky cholesky;
  const BlockStructure dense_loops = sparse_graph(rng, 300, 600, 3, false),
                       small = sparse_graph(rng, 60, 2, 3, false),
                       points = sparse_graph(rng, 300, 5, 2, false);
  for (const BlockStructure* s : {&dense_loops, &small, &points}) {
    BlockMatrix H(*s);
    test::fill_positive_definite(rng, H);
    cholesky.analyze(*s, "auto");
    EXPECT_TRUE(cholesky.chains().empty());
    ASSERT_TRUE(cholesky.factorize(H).ok);
    const Eigen::VectorXd g = Eigen::VectorXd::Random(s->size());
    const std::vector<double> x = solved(cholesky, g);
    const Eigen::VectorXd expected = dense(H).ldlt().solve(g);
    EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(x.data(), g.size()) - expected).norm(),
              1e-11 * expected.norm());
  }
  const BlockStructure sparse = sparse_graph(rng, 300, 5, 3, false);
  cholesky.analyze(sparse, "amd");
  EXPECT_TRUE(cholesky.chains().empty());
}

}  // namespace
}  // namespace cairn::block
