// SPDX-License-Identifier: BSD-3-Clause
// The preconditioners of pcg by themselves.
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "cairn/plugin/registry.hpp"
#include "pcg/block_jacobi.hpp"
#include "pcg/incomplete_cholesky.hpp"
#include "pcg/spanning_tree.hpp"
#include "pcg/subgraph.hpp"
#include "support/block_systems.hpp"
#include "support/dense_algebra.hpp"
#include "support/sample_jacobians.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;

/// M⁻¹ column by column.
Eigen::MatrixXd inverse(Preconditioner& preconditioner, std::int64_t n) {
  Eigen::MatrixXd whole(n, n);
  for (std::int64_t k = 0; k < n; ++k) {
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, k);
    const double product = preconditioner.apply({unit.data(), static_cast<std::size_t>(n)},
                                                {whole.col(k).data(), static_cast<std::size_t>(n)});
    EXPECT_NEAR(product, whole(k, k), 1e-12 * std::abs(product)) << "rᵀz is another";
  }
  return whole;
}

Eigen::MatrixXd inverse_for(Preconditioner& preconditioner, const BlockMatrix& H) {
  iterative::DiagonalBlocks diagonal;
  diagonal.analyze(H.structure());
  EXPECT_TRUE(diagonal.factorize(H).ok);
  preconditioner.analyze(H.structure());
  EXPECT_TRUE(preconditioner.factorize(H, diagonal, nullptr).ok);
  return inverse(preconditioner, H.structure().size());
}

std::unique_ptr<Preconditioner> subgraph(double extra) {
  Registry registry;
  return std::make_unique<Subgraph>(registry.make<LinearSolver>("eigen"), extra);
}

void expect_symmetric_positive_definite(const Eigen::MatrixXd& M) {
  EXPECT_LE((M - M.transpose()).norm(), 1e-12 * M.norm());
  EXPECT_GT(eigenvalues_of(M).minCoeff(), 0.0);
}

std::vector<std::unique_ptr<Preconditioner>> every_preconditioner() {
  std::vector<std::unique_ptr<Preconditioner>> all;
  all.push_back(std::make_unique<BlockJacobi>());
  all.push_back(std::make_unique<IncompleteCholesky>());
  if (Registry().has("linear_solver", "eigen")) {
    all.push_back(subgraph(0.0));
    all.push_back(subgraph(0.3));
  }
  return all;
}

TEST(Preconditioner, IsSymmetricPositiveDefinite) {
  for (const auto& preconditioner : every_preconditioner()) {
    for (const NamedStructure& sample : sample_structures()) {
      SCOPED_TRACE(sample.name + ", " + preconditioner->note());
      for (const double shift : {1e-6, 0.1}) {  // nearly singular, and well
        BlockMatrix H(sample.structure);
        fill_positive_definite(H, 21, shift);
        expect_symmetric_positive_definite(inverse_for(*preconditioner, H));
      }
    }
  }
}

TEST(IncompleteCholesky, IsExactWhereNothingFillsIn) {
  const BlockStructure chain = sample_structures()[3].structure;
  BlockMatrix H(chain);
  fill_positive_definite(H, 22);
  IncompleteCholesky preconditioner;
  const Eigen::MatrixXd product = inverse_for(preconditioner, H) * dense(H);
  EXPECT_LE((product - Eigen::MatrixXd::Identity(product.rows(), product.cols())).norm(), 1e-10);
  EXPECT_EQ(preconditioner.shift(), 0.0);
}

TEST(IncompleteCholesky, ShiftsTheDiagonalWhereItBreaksDown) {
  // Kershaw's matrix (1978): positive definite, and an incomplete factorisation without fill meets
  // a negative pivot.
  const BlockStructure structure({1, 1, 1, 1}, {{1, 0}, {2, 1}, {3, 2}, {3, 0}});
  BlockMatrix H(structure);
  const auto set = [&](int row, int column, double value) {
    H.block(structure.find(row, column))[0] = value;
  };
  for (int k = 0; k < 4; ++k) set(k, k, 3.0);
  for (int k = 1; k < 4; ++k) set(k, k - 1, -2.0);
  set(3, 0, 2.0);
  ASSERT_EQ(dense(H).llt().info(), Eigen::Success);
  IncompleteCholesky preconditioner;
  expect_symmetric_positive_definite(inverse_for(preconditioner, H));
  EXPECT_GT(preconditioner.shift(), 0.0);
  EXPECT_THAT(preconditioner.note(), testing::HasSubstr("shifted"));
}

TEST(Subgraph, IsExactOnATree) {
  if (!Registry().has("linear_solver", "eigen")) GTEST_SKIP();
  for (const int sample : {3, 7, 8}) {  // a chain and two arrows
    const BlockStructure tree = sample_structures()[sample].structure;
    BlockMatrix H(tree);
    fill_positive_definite(H, 23);
    const Eigen::MatrixXd product = inverse_for(*subgraph(0.0), H) * dense(H);
    EXPECT_LE((product - Eigen::MatrixXd::Identity(product.rows(), product.cols())).norm(), 1e-10);
  }
}

TEST(NormalBlocks, AreTheSquareOfTheJacobian) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    JacobianMatrix J(structure);
    fill_full_rank(J, 31);
    NormalBlocks factors;
    factors.analyze(structure);
    BlockMatrix H(factors.structure());
    const Eigen::MatrixXd expected = dense(J).transpose() * dense(J);
    factors.load(J, {});
    factors.assemble(H);
    EXPECT_LE((dense(H) - expected).norm(), 1e-14 * expected.norm());
    const std::vector<double> damping(static_cast<std::size_t>(structure.size()), 0.25);
    factors.load(J, damping);
    factors.assemble(H);
    const Eigen::MatrixXd added = dense(H) - expected;
    EXPECT_LE((added - 0.25 * Eigen::MatrixXd::Identity(added.rows(), added.cols())).norm(),
              1e-14 * expected.norm());
  }
}

TEST(Subgraph, LeavesTheOtherFactorsOutWhereItKnowsThem) {
  if (!Registry().has("linear_solver", "eigen")) GTEST_SKIP();
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    JacobianMatrix J(structure);
    fill_full_rank(J, 32);
    NormalBlocks factors;
    factors.analyze(structure);
    factors.load(J, {});
    BlockMatrix H(factors.structure());
    factors.assemble(H);
    iterative::DiagonalBlocks diagonal;
    diagonal.analyze(H.structure());
    ASSERT_TRUE(diagonal.factorize(H).ok);
    const auto preconditioner = subgraph(0.0);
    preconditioner->analyze(H.structure());
    ASSERT_TRUE(preconditioner->factorize(H, diagonal, &factors).ok);
    // H − M is the square of the factors left out, so no eigenvalue of M⁻¹H is below 1, and all are
    // 1 but three for each.
    const Eigen::MatrixXd M = inverse_of(inverse(*preconditioner, H.structure().size()));
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        dense(H), 0.5 * (M + M.transpose()), Eigen::EigenvaluesOnly);
    EXPECT_GE(eigen.eigenvalues().minCoeff(), 1.0 - 1e-9);
    const std::int64_t edges = sample.structure.entries() - sample.structure.blocks();
    const std::int64_t left_out =
        edges - static_cast<std::int64_t>(
                    choose_subgraph(H.structure(), coupling_strengths(H, diagonal), 0).size());
    EXPECT_LE((eigen.eigenvalues().array() > 1.0 + 1e-9).count(), 3 * left_out);
  }
}

TEST(Subgraph, BoundsTheEigenvaluesByTwo) {
  if (!Registry().has("linear_solver", "eigen")) GTEST_SKIP();
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    BlockMatrix H(sample.structure);
    fill_positive_definite(H, 24);
    const Eigen::MatrixXd M_inverse = inverse_for(*subgraph(0.0), H);
    const Eigen::MatrixXd M = inverse_of(M_inverse);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        dense(H), 0.5 * (M + M.transpose()), Eigen::EigenvaluesOnly);
    EXPECT_LE(eigen.eigenvalues().maxCoeff(), 2.0 + 1e-9);
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.0);
  }
}

TEST(Subgraph, TakesTheStrongestTreeAndTheLongestWayRound) {
  // A ring of six with one weak edge, and a chord.
  const BlockStructure structure(std::vector<std::int32_t>(6, 1),
                                 {{1, 0}, {2, 1}, {3, 2}, {4, 3}, {5, 4}, {5, 0}, {2, 0}});
  std::vector<double> strength(static_cast<std::size_t>(structure.entries()), 0.0);
  const auto set = [&](int row, int column, double value) {
    strength[structure.find(row, column)] = value;
  };
  for (int k = 1; k < 6; ++k) set(k, k - 1, 1.0);
  set(5, 0, 0.9);
  set(2, 0, 0.95);
  const auto entry = [&](int row, int column) { return structure.find(row, column); };
  const std::vector<std::int64_t> tree = choose_subgraph(structure, strength, 0);
  EXPECT_THAT(tree, ElementsAre(entry(1, 0), entry(2, 1), entry(3, 2), entry(4, 3), entry(5, 4)));
  // Round through the tree: 5 for the ring's closure, 2 for the chord.
  EXPECT_THAT(
      choose_subgraph(structure, strength, 1),
      ElementsAre(entry(1, 0), entry(5, 0), entry(2, 1), entry(3, 2), entry(4, 3), entry(5, 4)));
  EXPECT_EQ(choose_subgraph(structure, strength, 99).size(), 7U);
}

}  // namespace
}  // namespace cairn::test
