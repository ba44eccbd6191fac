// SPDX-License-Identifier: BSD-3-Clause
#include "block/selected_inverse.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>

#include <Eigen/Core>

#include "block/ordering.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/block_systems.hpp"
#include "support/dense_algebra.hpp"
#include "support/kernel_sets.hpp"

namespace cairn::block {
namespace {

using test::dense;
using test::fill_positive_definite;
using test::kernel_sets;
using test::random_structure;

std::vector<double> diagonal(const SelectedInverse& inverse, const BlockStructure& structure) {
  std::int64_t size = 0;
  for (const std::int32_t rows : structure.sizes()) size += std::int64_t{rows} * rows;
  std::vector<double> out(size);
  inverse.diagonal_blocks(out);
  return out;
}

/// Every block that the selected inverse has, against the dense one; the diagonal both ways.
/// Returns how many blocks it has.
int expect_agreement(const SelectedInverse& inverse, const BlockStructure& s,
                     const Eigen::MatrixXd& Z) {
  int there = 0;
  const std::vector<double> all = diagonal(inverse, s);
  const double* next = all.data();
  for (int i = 0; i < s.blocks(); ++i) {
    for (int j = 0; j < s.blocks(); ++j) {
      const Eigen::MatrixXd expected =
          Z.block(s.offsets()[i], s.offsets()[j], s.block_size(i), s.block_size(j));
      Eigen::MatrixXd block(s.block_size(i), s.block_size(j));
      const bool has = inverse.block(i, j, block.data());
      EXPECT_TRUE(has || (i != j && s.find(std::max(i, j), std::min(i, j)) < 0));
      if (has) {
        ++there;
        const double scale = std::sqrt(
            Z.block(s.offsets()[i], s.offsets()[i], s.block_size(i), s.block_size(i)).norm() *
            Z.block(s.offsets()[j], s.offsets()[j], s.block_size(j), s.block_size(j)).norm());
        EXPECT_LE((block - expected).norm(), 1e-9 * scale) << i << ' ' << j;
      }
      if (i == j) {
        const Eigen::Map<const Eigen::MatrixXd> own(next, block.rows(), block.cols());
        EXPECT_TRUE((own.array() == block.array()).all());
        EXPECT_TRUE((own.array() == own.transpose().array()).all());
        next += block.size();
      }
    }
  }
  return there;
}

TEST(SelectedInverse, AgreesWithTheDenseInverseForEveryKernelSetAndBlockSize) {
  std::mt19937 rng(31);
  const std::vector<std::vector<std::int32_t>> mixes = {
      {3}, {6}, {2, 3}, {3, 6}, {1}, {1, 2, 3, 6, 7, 9}, {8}, {13, 1}};
  for (int trial = 0; trial < 80; ++trial) {
    const int blocks = 1 + static_cast<int>(rng() % 60);
    const BlockStructure structure = random_structure(
        rng, blocks, static_cast<int>(rng() % (2 * blocks)), mixes[trial % mixes.size()]);
    BlockMatrix H(structure);
    fill_positive_definite(rng, H);
    const Eigen::MatrixXd Z = test::inverse_of(test::dense(H));
    for (const std::string& kernels : kernel_sets()) {
      for (const char* ordering : {"amd", "natural", "auto"}) {
        SCOPED_TRACE(kernels + ' ' + ordering + ' ' + std::to_string(trial));
        SupernodalCholesky cholesky(kernels);
        cholesky.analyze(structure, ordering);
        ASSERT_TRUE(cholesky.factorize(H).ok);
        SelectedInverse inverse(cholesky);
        inverse.compute();
        expect_agreement(inverse, structure, Z);
      }
    }
  }
}

/// Without diagonal dominance: far blocks are as much correlated as near ones.
void fill_like_a_chain(BlockMatrix& H) {
  const BlockStructure& s = H.structure();
  H.set_zero();
  const auto diagonal = [&](int k) {
    return Eigen::Map<Eigen::MatrixXd>(H.block(s.column_begin()[k]), s.block_size(k),
                                       s.block_size(k));
  };
  for (int j = 0; j < s.blocks(); ++j) {
    diagonal(j).diagonal().array() += 1e-3;
    for (std::int64_t e = s.column_begin()[j] + 1; e < s.column_begin()[j + 1]; ++e) {
      const int i = s.rows()[e];
      const Eigen::MatrixXd J = Eigen::MatrixXd::Random(s.block_size(i), s.block_size(j)) +
                                Eigen::MatrixXd::Identity(s.block_size(i), s.block_size(j));
      Eigen::Map<Eigen::MatrixXd>(H.block(e), s.block_size(i), s.block_size(j)) = -J;
      diagonal(j) += J.transpose() * J;
      diagonal(i) += Eigen::MatrixXd::Identity(s.block_size(i), s.block_size(i));
    }
  }
}

TEST(SelectedInverse, AgreesWhereEverythingIsCorrelated) {
  std::mt19937 rng(32);
  for (const std::int32_t size : {3, 6}) {
    const BlockStructure structure = random_structure(rng, 90, 60, {size});
    BlockMatrix H(structure);
    fill_like_a_chain(H);
    const Eigen::MatrixXd Z = test::symmetric_inverse(test::dense(H));
    for (const std::string& kernels : kernel_sets()) {
      SupernodalCholesky cholesky(kernels);
      cholesky.analyze(structure, "amd");
      ASSERT_TRUE(cholesky.factorize(H).ok);
      SelectedInverse inverse(cholesky);
      inverse.compute();
      expect_agreement(inverse, structure, Z);
    }
  }
}

TEST(SelectedInverse, TakesSupernodesOfOneBlockAndOneOfAll) {
  std::mt19937 rng(33);
  const BlockStructure structure = random_structure(rng, 60, 50, {3, 2});
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::MatrixXd Z = test::inverse_of(test::dense(H));
  const CostModel never{.supernode = 0.0,
                        .panel_entry = 1.0,
                        .panel_flop = 1.0,
                        .update_flop = 1.0,
                        .extend_entry = 0.0};
  const CostModel always{.supernode = 1e9};
  for (const std::string& kernels : kernel_sets()) {
    SupernodalCholesky fine(kernels), coarse(kernels);
    fine.analyze(structure, "amd", never);
    coarse.analyze(structure, "amd", always);
    ASSERT_TRUE(fine.factorize(H).ok);
    ASSERT_TRUE(coarse.factorize(H).ok);
    SelectedInverse of_fine(fine), of_coarse(coarse);
    of_fine.compute();
    of_coarse.compute();
    EXPECT_LT(expect_agreement(of_fine, structure, Z), structure.blocks() * structure.blocks());
    EXPECT_EQ(expect_agreement(of_coarse, structure, Z), structure.blocks() * structure.blocks());
  }
}

TEST(SelectedInverse, GivesTheSameBitsForAnyNumberOfThreads) {
  std::mt19937 rng(34);
  const BlockStructure structure = test::solid_grid(9, 6);  // has fronts that are cut into tiles
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const int before = threads();
  std::vector<double> first;
  for (const int count : {1, 2, 3, 5}) {
    set_threads(count);
    SupernodalCholesky cholesky;
    cholesky.analyze(structure, "amd");
    ASSERT_TRUE(std::ranges::any_of(cholesky.symbolic().supernodes(), is_large, &Supernode::m));
    ASSERT_TRUE(cholesky.factorize(H).ok);
    SelectedInverse inverse(cholesky);
    inverse.compute();
    const std::vector<double> all = diagonal(inverse, structure);
    if (first.empty()) first = all;
    EXPECT_EQ(all, first) << count << " threads";
    ASSERT_TRUE(cholesky.factorize(H).ok);  // the room that they share is as good as before
    inverse.compute();
    EXPECT_EQ(diagonal(inverse, structure), first);
    set_threads(count + 1);
    cholesky.analyze(structure, "amd");  // makes all room anew
    ASSERT_TRUE(cholesky.factorize(H).ok);
    inverse.compute();
    EXPECT_EQ(diagonal(inverse, structure), first);
  }
  set_threads(before);
}

TEST(SelectedInverse, AgreesInWideFronts) {
  std::mt19937 rng(35);
  const BlockStructure structure = test::solid_grid(6, 6);
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::MatrixXd Z = test::inverse_of(test::dense(H));
  const int before = threads();
  for (const int count : {1, 2}) {
    set_threads(count);
    for (const std::string& kernels : kernel_sets()) {
      SupernodalCholesky cholesky(kernels);
      cholesky.analyze(structure, "amd");
      ASSERT_TRUE(std::ranges::any_of(cholesky.symbolic().supernodes(), is_large, &Supernode::m));
      ASSERT_TRUE(cholesky.factorize(H).ok);
      SelectedInverse inverse(cholesky);
      inverse.compute();
      expect_agreement(inverse, structure, Z);
    }
  }
  set_threads(before);
}

TEST(SelectedInverse, NeedsAFactorisation) {
  const BlockStructure structure({3}, {});
  SupernodalCholesky cholesky;
  SelectedInverse inverse(cholesky);
  EXPECT_THROW(inverse.compute(), std::logic_error);
  cholesky.analyze(structure, "amd");
  EXPECT_THROW(inverse.compute(), std::logic_error);
}

TEST(SupernodalCholesky, FindsColumnsOfTheInverse) {
  std::mt19937 rng(36);
  const BlockStructure structure = random_structure(rng, 150, 130, {2, 3, 9});
  BlockMatrix H(structure);
  fill_positive_definite(rng, H);
  const Eigen::MatrixXd Z = test::inverse_of(test::dense(H));
  const int before = threads();
  for (const int count : {1, 3}) {
    set_threads(count);
    for (const std::string& kernels : kernel_sets()) {
      SupernodalCholesky cholesky(kernels);
      cholesky.analyze(structure, "amd");
      ASSERT_TRUE(cholesky.factorize(H).ok);
      for (const int columns : {1, 8, 19}) {
        std::vector<std::int64_t> scalars;
        for (int k = 0; k < columns; ++k)
          scalars.push_back(static_cast<std::int64_t>(rng()) % structure.size());
        Eigen::MatrixXd X(structure.size(), columns);
        cholesky.inverse_columns(scalars, {X.data(), static_cast<std::size_t>(X.size())});
        for (int k = 0; k < columns; ++k)
          EXPECT_LE((X.col(k) - Z.col(scalars[k])).norm(), 1e-10 * Z.col(scalars[k]).norm());
      }
    }
  }
  set_threads(before);
}

}  // namespace
}  // namespace cairn::block
