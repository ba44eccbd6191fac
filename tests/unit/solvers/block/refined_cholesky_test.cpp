// SPDX-License-Identifier: BSD-3-Clause
#include "block/refined_cholesky.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "block/chain_cholesky.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/block_systems.hpp"
#include "support/kernel_sets.hpp"

namespace cairn::block {
namespace {

using test::dense;
using test::kernel_sets;
using test::random_structure;
using test::solid_grid;

/// A random rotation or reflection.
Eigen::MatrixXd random_orthogonal(std::mt19937& rng, int size) {
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd A = Eigen::MatrixXd::NullaryExpr(size, size, [&] { return normal(rng); });
  return Eigen::HouseholderQR<Eigen::MatrixXd>(A).householderQ();
}

/// Σ w |R_ij x_i - x_j|² over the entries, with weights w from 1 to `spread` and rotations R that
/// agree around every loop, + `prior` |x_0|²: as a pose graph has it, positive definite by its
/// prior alone. Variables have the units `units`.
void fill_as_pose_graph(std::mt19937& rng, double prior, double spread, double units,
                        BlockMatrix& H) {
  const BlockStructure& s = H.structure();
  H.set_zero();
  const int size = s.block_size(0);
  std::vector<Eigen::MatrixXd> rotations;
  std::vector<double> unit;
  std::uniform_real_distribution<double> share(0.0, 1.0);
  for (int j = 0; j < s.blocks(); ++j) {
    rotations.push_back(random_orthogonal(rng, size));
    unit.push_back(std::pow(units, share(rng)));
  }
  const auto block = [&](std::int64_t entry) {
    return Eigen::Map<Eigen::MatrixXd>(H.block(entry), size, size);
  };
  for (int j = 0; j < s.blocks(); ++j) {
    for (std::int64_t e = s.column_begin()[j] + 1; e < s.column_begin()[j + 1]; ++e) {
      const int i = s.rows()[e];
      const double w = std::pow(spread, share(rng));
      block(e) = -w * unit[i] * unit[j] * rotations[i] * rotations[j].transpose();
      block(s.column_begin()[i]) += w * unit[i] * unit[i] * Eigen::MatrixXd::Identity(size, size);
      block(s.column_begin()[j]) += w * unit[j] * unit[j] * Eigen::MatrixXd::Identity(size, size);
    }
  }
  block(0) += prior * unit[0] * unit[0] * Eigen::MatrixXd::Identity(size, size);
}

template <class Cholesky>
Eigen::VectorXd solve(Cholesky& cholesky, const Eigen::VectorXd& g) {
  Eigen::VectorXd x(g.size());
  cholesky.solve(std::span(g.data(), static_cast<std::size_t>(g.size())),
                 std::span(x.data(), static_cast<std::size_t>(x.size())));
  return x;
}

bool fell_back(const RefinedCholesky& cholesky) {
  return cholesky.description().find("then double precision") != std::string::npos;
}

/// The criterion of the class, on dense matrices.
double scaled_residual(const Eigen::MatrixXd& H, const Eigen::VectorXd& x,
                       const Eigen::VectorXd& g) {
  const Eigen::ArrayXd d = H.diagonal().array().sqrt();
  return ((H * x - g).array() / d).abs().maxCoeff() /
         ((d * x.array()).abs().maxCoeff() + (g.array() / d).abs().maxCoeff());
}

TEST(RefinedCholesky, AgreesWithDenseAlgebraHoweverConditioned) {
  std::mt19937 rng(31);
  int refined = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const BlockStructure structure =
        trial % 10 == 9 ? solid_grid(5, 6)
                        : random_structure(rng, 2 + static_cast<int>(rng() % 60),
                                           static_cast<int>(rng() % 80), {trial % 2 == 0 ? 3 : 6});
    BlockMatrix H(structure);
    fill_as_pose_graph(rng, std::pow(10.0, -(trial % 8)), trial % 3 == 0 ? 1e4 : 10.0,
                       trial % 5 == 0 ? 1e6 : 1.0, H);
    const Eigen::MatrixXd D = dense(H);
    const Eigen::VectorXd truth = Eigen::VectorXd::Random(D.rows());
    const Eigen::VectorXd g = D * truth;
    for (const std::string& kernels : kernel_sets()) {
      SCOPED_TRACE(kernels + ' ' + std::to_string(trial));
      RefinedCholesky mixed(kernels, Precision::mixed);
      mixed.analyze(structure, "auto");
      ASSERT_TRUE(mixed.factorize(H).ok);
      const Eigen::VectorXd x = solve(mixed, g);
      EXPECT_LE((D * x - g).norm(), 1e-10 * g.norm());
      EXPECT_LE(scaled_residual(D, x, g), 4e-15);  // that of the test is rounded too
      if (!fell_back(mixed)) ++refined;
      EXPECT_TRUE(fell_back(mixed) || mixed.steps() > 0);
    }
  }
  EXPECT_GE(refined, 30 * static_cast<int>(kernel_sets().size()));
}

// A prior of 1e-12 beside weights of 1: single precision cannot tell H from a singular matrix.
TEST(RefinedCholesky, FallsBackToDoubleWhereConditioningForbidsSingle) {
  std::mt19937 rng(32);
  for (int trial = 0; trial < 10; ++trial) {
    const BlockStructure structure = random_structure(rng, 40, 40, {3});
    BlockMatrix H(structure);
    fill_as_pose_graph(rng, 1e-12, 1.0, 1.0, H);
    const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
    RefinedCholesky mixed("auto", Precision::mixed), in_double("auto", Precision::in_double);
    mixed.analyze(structure, "amd");
    in_double.analyze(structure, "amd");
    ASSERT_TRUE(mixed.factorize(H).ok);
    ASSERT_TRUE(in_double.factorize(H).ok);
    EXPECT_EQ(solve(mixed, g), solve(in_double, g)) << "to the last bit";
    EXPECT_TRUE(fell_back(mixed)) << mixed.description();
    EXPECT_EQ(in_double.description(), "");

    // What follows is double as well, until the next analysis.
    fill_as_pose_graph(rng, 1.0, 1.0, 1.0, H);
    ASSERT_TRUE(mixed.factorize(H).ok);
    ASSERT_TRUE(in_double.factorize(H).ok);
    EXPECT_EQ(solve(mixed, g), solve(in_double, g));
    EXPECT_EQ(mixed.steps(), 0);
    mixed.analyze(structure, "amd");
    ASSERT_TRUE(mixed.factorize(H).ok);
    EXPECT_LE((solve(mixed, g) - solve(in_double, g)).norm(), 1e-12 * g.norm());
    EXPECT_FALSE(fell_back(mixed));
    EXPECT_GT(mixed.steps(), 0);
  }
}

// Between what ten steps refine and what single precision cannot factor.
TEST(RefinedCholesky, FallsBackToDoubleWhereRefinementIsSlow) {
  std::mt19937 rng(38);
  int slow = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const BlockStructure structure = random_structure(rng, 60, 20, {3});
    BlockMatrix H(structure);
    fill_as_pose_graph(rng, std::pow(10.0, -3.0 - 0.1 * trial), 1e4, 1.0, H);
    const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
    RefinedCholesky mixed("auto", Precision::mixed), in_double("auto", Precision::in_double);
    mixed.analyze(structure, "amd");
    in_double.analyze(structure, "amd");
    ASSERT_TRUE(mixed.factorize(H).ok);
    ASSERT_TRUE(in_double.factorize(H).ok);
    const Eigen::VectorXd x = solve(mixed, g);
    if (mixed.description().find("ten steps") == std::string::npos) continue;
    ++slow;
    EXPECT_TRUE(fell_back(mixed));
    EXPECT_EQ(x, solve(in_double, g)) << "to the last bit";
    EXPECT_EQ(solve(mixed, g), x);
  }
  EXPECT_GE(slow, 1);
}

TEST(RefinedCholesky, SolvesWhatSinglePrecisionHasNoRangeFor) {
  std::mt19937 rng(33);
  const BlockStructure structure = random_structure(rng, 50, 40, {3, 3});
  BlockMatrix H(structure);
  for (const double scale : {1e-300, 1e-60, 1e-30, 1e-10, 1.0, 1e10, 1e30, 1e60, 1e300}) {
    fill_as_pose_graph(rng, 1.0, 10.0, 1.0, H);
    const Eigen::MatrixXd D = dense(H);
    for (double& value : H.values()) value *= scale;
    for (const double length : {1e-200, 1.0, 1e200}) {
      const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size()) * length;
      if (!std::isfinite(length / scale) || length / scale < 1e-280) continue;
      RefinedCholesky mixed("auto", Precision::mixed);
      mixed.analyze(structure, "auto");
      ASSERT_TRUE(mixed.factorize(H).ok) << scale;
      const Eigen::VectorXd x = solve(mixed, g) * (scale / length);
      EXPECT_LE((D * x - g / length).norm(), 1e-12) << scale << ' ' << length;
      EXPECT_EQ(fell_back(mixed), scale < 1e-50 || scale > 1e50) << scale;
    }
    RefinedCholesky mixed("auto", Precision::mixed);
    mixed.analyze(structure, "auto");
    ASSERT_TRUE(mixed.factorize(H).ok);
    EXPECT_EQ(solve(mixed, Eigen::VectorXd::Zero(structure.size())).norm(), 0.0);
  }
}

TEST(RefinedCholesky, KeepsWhatItFactored) {
  std::mt19937 rng(34);
  const BlockStructure structure = random_structure(rng, 60, 40, {6});
  BlockMatrix H(structure);
  fill_as_pose_graph(rng, 1.0, 10.0, 1.0, H);
  const Eigen::MatrixXd D = dense(H);
  RefinedCholesky mixed("auto", Precision::mixed);
  mixed.analyze(structure, "auto");
  ASSERT_TRUE(mixed.factorize(H).ok);
  H.set_zero();  // as an optimizer may that takes its damping away again
  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  EXPECT_LE((D * solve(mixed, g) - g).norm(), 1e-12 * g.norm());
  const double expected = Eigen::LDLT<Eigen::MatrixXd>(D).vectorD().array().log().sum();
  EXPECT_NEAR(mixed.log_determinant(), expected, 1e-11 * std::abs(expected));
}

TEST(RefinedCholesky, HasDeterminantsColumnsAndManySolutionsFromDoublePrecision) {
  std::mt19937 rng(35);
  const BlockStructure structure = random_structure(rng, 60, 50, {3});
  BlockMatrix H(structure);
  fill_as_pose_graph(rng, 1e-3, 10.0, 1.0, H);
  const auto size = static_cast<std::size_t>(structure.size());
  const Eigen::VectorXd G = Eigen::VectorXd::Random(structure.size() * 3);
  const auto outcome = [&](Precision precision, int which) {
    RefinedCholesky cholesky("auto", precision);
    cholesky.analyze(structure, "amd");
    EXPECT_TRUE(cholesky.factorize(H).ok);
    std::vector<double> numbers(size * 3);
    if (which == 0) numbers = {cholesky.log_determinant()};
    if (which == 1) cholesky.solve(std::span(G.data(), size * 3), numbers, 3);
    if (which == 2) cholesky.inverse_columns(std::vector<std::int64_t>{0, 7, 100}, numbers);
    return numbers;
  };
  for (const int which : {0, 1, 2})
    EXPECT_EQ(outcome(Precision::mixed, which), outcome(Precision::in_double, which)) << which;

  ChainCholesky mixed("auto", Precision::mixed), in_double;
  std::vector<double> blocks[2];
  for (ChainCholesky* cholesky : {&mixed, &in_double}) {
    cholesky->analyze(structure, "auto");
    ASSERT_TRUE(cholesky->factorize(H).ok);
    ChainInverse inverse(*cholesky);
    inverse.compute();
    std::vector<double>& out = blocks[cholesky == &mixed ? 0 : 1];
    out.resize(size * 3);
    inverse.diagonal_blocks(out);
  }
  EXPECT_EQ(blocks[0], blocks[1]);
}

TEST(RefinedCholesky, GivesTheSameBitsForAnyNumberOfThreads) {
  std::mt19937 rng(36);
  const BlockStructure structure = solid_grid(9, 6);
  BlockMatrix H(structure);
  fill_as_pose_graph(rng, 1.0, 100.0, 1.0, H);
  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  const int before = threads();
  std::vector<Eigen::VectorXd> results;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    RefinedCholesky mixed("auto", Precision::mixed);
    mixed.analyze(structure, "auto");
    EXPECT_TRUE(mixed.factorize(H).ok);
    results.push_back(solve(mixed, g));
    EXPECT_FALSE(fell_back(mixed));
  }
  set_threads(before);
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST(RefinedCholesky, RefusesWhatIsNotPositiveDefiniteAndGoesOn) {
  std::mt19937 rng(37);
  const BlockStructure structure = random_structure(rng, 40, 30, {3});
  BlockMatrix H(structure);
  RefinedCholesky mixed("auto", Precision::mixed);
  mixed.analyze(structure, "auto");
  fill_as_pose_graph(rng, 1.0, 1.0, 1.0, H);
  H.block(structure.column_begin()[17])[0] = -1e3;
  const Factorization failed = mixed.factorize(H);
  EXPECT_FALSE(failed.ok);
  EXPECT_EQ(failed.failed_block, 17);
  const Eigen::VectorXd g = Eigen::VectorXd::Random(structure.size());
  EXPECT_THROW(solve(mixed, g), std::logic_error);
  fill_as_pose_graph(rng, 1.0, 1.0, 1.0, H);
  ASSERT_TRUE(mixed.factorize(H).ok);
  EXPECT_LE((dense(H) * solve(mixed, g) - g).norm(), 1e-12 * g.norm());
  EXPECT_FALSE(fell_back(mixed)) << "a matrix that double refuses too says nothing";
}

}  // namespace
}  // namespace cairn::block
