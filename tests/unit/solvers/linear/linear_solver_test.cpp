// SPDX-License-Identifier: BSD-3-Clause
// What every linear solver owes besides what `cairn plugins --check` asks.
#include "cairn/linear/linear_solver.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/linear/jacobian.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/block_systems.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

Eigen::VectorXd random_vector(std::int64_t size, std::uint64_t seed) {
  Random random(seed);
  return Eigen::VectorXd::NullaryExpr(size, [&] { return random(); });
}

Eigen::VectorXd solve(LinearSolver& solver, const Eigen::VectorXd& g) {
  Eigen::VectorXd x(g.size());
  solver.solve({g.data(), static_cast<std::size_t>(g.size())},
               {x.data(), static_cast<std::size_t>(x.size())});
  return x;
}

/// The largest share of its length by which a solution may be off. Direct solvers owe ten digits
/// whatever the condition number; an iterative one owes its residual, and what that allows.
double promised_accuracy(const LinearSolver& solver, const BlockMatrix& H) {
  const LinearSolverStats& stats = solver.stats();
  if (stats.iterations == 0) return 1e-10;
  EXPECT_LE(stats.relative_residual, 1e-10) << "of a default tolerance";
  const Eigen::VectorXd eigenvalues = eigenvalues_of(dense(H));
  return 1e-10 * eigenvalues.maxCoeff() / eigenvalues.minCoeff();
}

/// Factorises H and compares a solution with that of a dense LDLᵀ.
void expect_agreement(LinearSolver& solver, const BlockMatrix& H, std::uint64_t seed) {
  const Factorization factorization = solver.factorize(H);
  ASSERT_TRUE(factorization.ok) << "stopped at block " << factorization.failed_block;
  const Eigen::VectorXd g = random_vector(H.structure().size(), seed);
  const Eigen::VectorXd expected = dense_solution(dense(H), g);
  const Eigen::VectorXd x = solve(solver, g);
  EXPECT_LE((x - expected).norm(), promised_accuracy(solver, H) * expected.norm());
}

/// Makes a block's own diagonal so negative that no neighbour can hide it.
void spoil(BlockMatrix& H, int block) {
  const BlockStructure& s = H.structure();
  double* values = H.block(s.column_begin()[block]);
  for (int k = 0; k < s.block_size(block); ++k) values[k * s.block_size(block) + k] = -1e3;
}

/// Whether a solver works on the Jacobian and on nothing else.
bool refuses_H(LinearSolver& solver) {
  if (!query<JacobianSolver>(solver)) return false;
  try {
    solver.analyze(BlockStructure({1}, {}));
  } catch (const Error&) {
    return true;
  }
  return false;
}

/// All but those that refuse H: they owe the same on the Jacobian (JacobianSolverTest).
std::vector<std::string> solvers_of_H() {
  Registry registry;
  std::vector<std::string> specs = every_component("linear_solver");
  std::erase_if(specs, [&](const std::string& spec) {
    return refuses_H(*registry.make<LinearSolver>(spec));
  });
  return specs;
}

class LinearSolverTest : public testing::TestWithParam<std::string> {
 protected:
  void TearDown() override { set_threads(0); }
  Registry registry_;
  std::unique_ptr<LinearSolver> solver_ = registry_.make<LinearSolver>(GetParam());
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(LinearSolverTest);
INSTANTIATE_TEST_SUITE_P(Registered, LinearSolverTest, testing::ValuesIn(solvers_of_H()),
                         test_name);

TEST_P(LinearSolverTest, AgreesWithDenseLdlt) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    BlockMatrix H(sample.structure);
    fill_positive_definite(H, 1);
    solver_->analyze(sample.structure);
    expect_agreement(*solver_, H, 2);
  }
}

/// How many threads this process has.
std::ptrdiff_t tasks() {
  const std::filesystem::directory_iterator all("/proc/self/task");
  return std::distance(begin(all), end(all));
}

// Libraries may ask for more on their own.
TEST_P(LinearSolverTest, StartsNoThreadWhereOneIsAllowed) {
  if (!std::filesystem::exists("/proc/self/task")) GTEST_SKIP() << "no /proc here";
  set_threads(1);
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;  // a band
  constexpr int kBlocks = 150, kBand = 25;
  for (int j = 0; j < kBlocks; ++j) {
    for (int i = j + 1; i < std::min(kBlocks, j + kBand); ++i) pairs.emplace_back(i, j);
  }
  const BlockStructure structure(std::vector<std::int32_t>(kBlocks, 6), std::move(pairs));
  BlockMatrix H(structure);
  fill_positive_definite(H, 4);
  const std::ptrdiff_t before = tasks();
  solver_->analyze(structure);
  ASSERT_TRUE(solver_->factorize(H).ok);
  solve(*solver_, random_vector(structure.size(), 3));
  EXPECT_LE(tasks(), before);
}

TEST_P(LinearSolverTest, NamesTheBlockAtWhichTheMatrixIsNotPositiveDefinite) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    solver_->analyze(sample.structure);
    const int blocks = sample.structure.blocks();
    for (const int spoilt : {0, blocks / 3, blocks / 2, blocks - 1}) {
      BlockMatrix H(sample.structure);
      fill_positive_definite(H, 6);
      spoil(H, spoilt);
      // Whatever was eliminated before is positive definite by itself, so no order can stop
      // elsewhere.
      const Factorization factorization = solver_->factorize(H);
      EXPECT_FALSE(factorization.ok);
      EXPECT_EQ(factorization.failed_block, spoilt);
    }
  }
}

TEST_P(LinearSolverTest, CountsItsFactor) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    BlockMatrix H(sample.structure);
    fill_positive_definite(H, 14);
    solver_->analyze(sample.structure);
    ASSERT_TRUE(solver_->factorize(H).ok);
    const LinearSolverStats& stats = solver_->stats();
    EXPECT_FALSE(stats.ordering.empty());
    const std::int64_t n = sample.structure.size();
    const std::int64_t own =
        ScalarPattern(sample.structure, ScalarPattern::Triangle::lower).nonzeros();
    if (stats.factor_nonzeros == 0) continue;  // not known
    EXPECT_GE(stats.factor_nonzeros, own);     // fill only adds
    EXPECT_LE(stats.factor_nonzeros, n * (n + 1) / 2);
    EXPECT_GE(stats.factor_flops, static_cast<double>(stats.factor_nonzeros));
  }
}

TEST_P(LinearSolverTest, GivesTheSameBitsForAnyNumberOfThreads) {
  const BlockStructure structure = sample_structures()[10].structure;
  BlockMatrix H(structure);
  fill_positive_definite(H, 15);
  const Eigen::VectorXd g = random_vector(structure.size(), 16);
  Eigen::VectorXd first;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    const auto solver = registry_.make<LinearSolver>(GetParam());
    solver->analyze(structure);
    ASSERT_TRUE(solver->factorize(H).ok);
    const Eigen::VectorXd x = solve(*solver, g);
    if (count == 1) first = x;
    EXPECT_EQ(x, first) << count << " threads";
  }
}

TEST_P(LinearSolverTest, RefusesCallsOutOfOrder) {
  const BlockStructure structure({3, 3}, {{1, 0}});
  BlockMatrix H(structure);
  fill_positive_definite(H, 17);
  std::vector<double> g(6, 1.0), x(6);
  EXPECT_THROW(solver_->factorize(H), std::logic_error);
  EXPECT_THROW(solver_->solve(g, x), std::logic_error);
  solver_->analyze(structure);
  EXPECT_THROW(solver_->solve(g, x), std::logic_error);
  ASSERT_TRUE(solver_->factorize(H).ok);
  const BlockStructure other({3, 3}, {{1, 0}});
  BlockMatrix H_other(other);
  fill_positive_definite(H_other, 17);
  EXPECT_THROW(solver_->factorize(H_other), std::logic_error);
}

}  // namespace
}  // namespace cairn::test
