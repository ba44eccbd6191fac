// SPDX-License-Identifier: BSD-3-Clause
// What every linear solver that works on the Jacobian owes, whoever wrote it.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "cairn/linear/jacobian.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/sample_jacobians.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

std::vector<std::string> solvers_of_the_jacobian() {
  Registry registry;
  std::vector<std::string> specs = every_component("linear_solver");
  std::erase_if(specs, [&](const std::string& spec) {
    return !query<JacobianSolver>(*registry.make<LinearSolver>(spec));
  });
  return specs;
}

Eigen::VectorXd minimize(JacobianSolver& solver, const JacobianMatrix& J) {
  Eigen::VectorXd x(J.structure().size());
  solver.minimize(J.residual(), {x.data(), static_cast<std::size_t>(x.size())});
  return x;
}

/// argmin ‖J x + r‖² + xᵀ D x by a dense QR.
Eigen::VectorXd dense_minimum(const JacobianMatrix& J, const std::vector<double>& damping) {
  const Eigen::MatrixXd top = dense(J);
  const auto extra = static_cast<Eigen::Index>(damping.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(top.rows() + extra, top.cols());
  A.topRows(top.rows()) = top;
  for (Eigen::Index k = 0; k < extra; ++k)
    A(top.rows() + k, k) = std::sqrt(damping[static_cast<std::size_t>(k)]);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(A.rows());
  for (Eigen::Index k = 0; k < top.rows(); ++k) b[k] = -J.residual()[static_cast<std::size_t>(k)];
  return A.colPivHouseholderQr().solve(b);
}

std::vector<double> some_damping(const JacobianStructure& structure) {
  std::vector<double> damping(static_cast<std::size_t>(structure.size()));
  for (std::size_t k = 0; k < damping.size(); ++k) damping[k] = 0.01 * static_cast<double>(k % 7);
  return damping;
}

void clear_column(JacobianMatrix& J, int column) {
  const JacobianStructure& s = J.structure();
  for (int row = 0; row < s.block_rows(); ++row) {
    for (std::int64_t e = s.row_begin()[row]; e < s.row_begin()[row + 1]; ++e) {
      if (s.columns()[e] == column)
        std::fill(J.block(e), J.block(e) + s.row_sizes()[row] * s.column_sizes()[column], 0.0);
    }
  }
}

/// The largest share of its length by which a solution may be off. Direct solvers owe ten digits;
/// an iterative one owes its residual in the normal equations, and what that allows.
double promised_accuracy(const LinearSolver& solver, const JacobianMatrix& J,
                         const std::vector<double>& damping) {
  if (solver.stats().iterations == 0) return 1e-10;
  EXPECT_LE(solver.stats().relative_residual, 1e-10) << "of a default tolerance";
  Eigen::MatrixXd H = dense(J).transpose() * dense(J);
  for (std::size_t k = 0; k < damping.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    H(row, row) += damping[k];
  }
  const Eigen::VectorXd eigenvalues = eigenvalues_of(H);
  return 1e-10 * eigenvalues.maxCoeff() / eigenvalues.minCoeff();
}

class JacobianSolverTest : public testing::TestWithParam<std::string> {
 protected:
  void TearDown() override { set_threads(0); }

  void expect_agreement(const JacobianMatrix& J, const std::vector<double>& damping) {
    const Factorization factorization = solver().factorize(J, damping);
    ASSERT_TRUE(factorization.ok) << "stopped at block " << factorization.failed_block;
    const Eigen::VectorXd expected = dense_minimum(J, damping);
    const Eigen::VectorXd x = minimize(solver(), J);
    EXPECT_LE((x - expected).norm(),
              promised_accuracy(*component_, J, damping) * (1e-6 + expected.norm()));
  }
  bool is_iterative() const { return GetParam().rfind("pcg", 0) == 0; }
  JacobianSolver& solver() { return *query<JacobianSolver>(*component_); }

  Registry registry_;
  std::unique_ptr<LinearSolver> component_ = registry_.make<LinearSolver>(GetParam());
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(JacobianSolverTest);
INSTANTIATE_TEST_SUITE_P(Registered, JacobianSolverTest,
                         testing::ValuesIn(solvers_of_the_jacobian()), test_name);

TEST_P(JacobianSolverTest, AgreesWithADenseQrDampedOrNot) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    JacobianMatrix J(structure);
    solver().analyze(structure);
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      fill_full_rank(J, seed);
      expect_agreement(J, {});
      expect_agreement(J, some_damping(structure));
    }
  }
}

TEST_P(JacobianSolverTest, KeepsTheDigitsThatNormalEquationsLose) {
  // Two unknowns that only a measurement 1e-9 as strong tells apart: 1 + 1e-18 is 1 in H.
  const JacobianStructure structure({1, 1, 1}, {1, 1}, {0, 2, 3, 4}, {0, 1, 0, 1});
  JacobianMatrix J(structure);
  const std::array<double, 4> values{1.0, 1.0, 1e-9, 1e-9};
  std::copy(values.begin(), values.end(), J.values().begin());
  if (is_iterative()) GTEST_SKIP() << GetParam() << " squares J to find its residual";
  const std::array<double, 3> r{-3.0, -1e-9, -2e-9};  // solved exactly by x = (1, 2)
  std::copy(r.begin(), r.end(), J.residual().begin());
  solver().analyze(structure);
  ASSERT_TRUE(solver().factorize(J, {}).ok);
  const Eigen::VectorXd x = minimize(solver(), J);
  EXPECT_NEAR(x[0], 1.0, 1e-6);
  EXPECT_NEAR(x[1], 2.0, 1e-6);
}

TEST_P(JacobianSolverTest, SolvesForSeveralResiduals) {
  const JacobianStructure structure = jacobian_structure(sample_structures().back().structure);
  JacobianMatrix J(structure);
  fill_full_rank(J, 5);
  solver().analyze(structure);
  ASSERT_TRUE(solver().factorize(J, {}).ok);
  for (int k = 1; k <= 3; ++k) {
    for (double& value : J.residual()) value = 1.7 * value + k;
    const Eigen::VectorXd expected = dense_minimum(J, {}), x = minimize(solver(), J);
    EXPECT_LE((x - expected).norm(), promised_accuracy(*component_, J, {}) * expected.norm());
  }
}

TEST_P(JacobianSolverTest, NamesTheBlockThatNothingDetermines) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    solver().analyze(structure);
    const int blocks = structure.block_columns();
    for (const int loose : {0, blocks / 3, blocks / 2, blocks - 1}) {
      JacobianMatrix J(structure);
      fill_full_rank(J, 6);
      clear_column(J, loose);
      const Factorization factorization = solver().factorize(J, {});
      EXPECT_FALSE(factorization.ok);
      EXPECT_EQ(factorization.failed_block, loose);
      const std::vector<double> damping(static_cast<std::size_t>(structure.size()), 1e-6);
      expect_agreement(J, damping);  // damping determines it
    }
  }
}

TEST_P(JacobianSolverTest, SeesAColumnThatDependsOnOthers) {
  if (is_iterative()) GTEST_SKIP() << GetParam() << " solves what is only semidefinite";
  // Differences alone: all unknowns may move together.
  std::vector<std::int64_t> row_begin{0};
  std::vector<std::int32_t> columns;
  constexpr int kUnknowns = 40;
  for (int k = 0; k < kUnknowns; ++k) {
    columns.push_back(k);
    columns.push_back((k + 1) % kUnknowns);
    row_begin.push_back(2 * (k + 1));
  }
  const JacobianStructure structure(std::vector<std::int32_t>(kUnknowns, 2),
                                    std::vector<std::int32_t>(kUnknowns, 2), row_begin, columns);
  JacobianMatrix J(structure);
  for (std::int64_t e = 0; e < structure.entries(); ++e) {
    const double sign = e % 2 == 0 ? -3.0 : 3.0;
    J.block(e)[0] = J.block(e)[3] = sign;
    J.block(e)[1] = 0.1 * sign;
  }
  solver().analyze(structure);
  EXPECT_FALSE(solver().factorize(J, {}).ok);
}

TEST_P(JacobianSolverTest, RefusesValuesThatAreNotFiniteAndRecovers) {
  const JacobianStructure structure = jacobian_structure(sample_structures()[11].structure);
  solver().analyze(structure);
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    JacobianMatrix J(structure);
    fill_full_rank(J, 10);
    J.block(structure.entries() / 2)[0] = value;
    const Factorization factorization = solver().factorize(J, {});
    EXPECT_FALSE(factorization.ok) << value;
    EXPECT_LT(factorization.failed_block, structure.block_columns());
  }
  JacobianMatrix J(structure);
  EXPECT_FALSE(solver().factorize(J, {}).ok) << "zero";
  fill_full_rank(J, 11);
  expect_agreement(J, {});
}

TEST_P(JacobianSolverTest, TellsItsLogDeterminantIfItCan) {
  auto* ability = query<LogDeterminant>(*component_);
  if (!ability) GTEST_SKIP() << GetParam() << " has no log determinant";
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    JacobianMatrix J(structure);
    fill_full_rank(J, 13);
    solver().analyze(structure);
    const Eigen::MatrixXd H = dense(J).transpose() * dense(J);
    for (const std::vector<double>& damping :
         {std::vector<double>{}, std::vector<double>(H.rows(), 0.5)}) {
      ASSERT_TRUE(solver().factorize(J, damping).ok);
      Eigen::MatrixXd damped = H;
      if (!damping.empty()) damped.diagonal().array() += 0.5;
      const double expected =
          damped.householderQr().matrixQR().diagonal().array().abs().log().sum();
      EXPECT_NEAR(ability->log_determinant(), expected, 1e-9 * (1.0 + std::abs(expected)));
    }
  }
}

TEST_P(JacobianSolverTest, CountsItsFactor) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    JacobianMatrix J(structure);
    fill_full_rank(J, 14);
    solver().analyze(structure);
    ASSERT_TRUE(solver().factorize(J, {}).ok);
    const LinearSolverStats& stats = component_->stats();
    EXPECT_FALSE(stats.ordering.empty());
    if (stats.factor_nonzeros == 0) continue;  // not known
    EXPECT_GE(stats.factor_nonzeros, structure.size());
    EXPECT_LE(stats.factor_nonzeros, structure.size() * (structure.size() + 1) / 2);
    EXPECT_GT(stats.factor_flops, 0.0);
  }
}

TEST_P(JacobianSolverTest, GivesTheSameBitsForAnyNumberOfThreads) {
  const JacobianStructure structure = jacobian_structure(sample_structures()[10].structure);
  JacobianMatrix J(structure);
  fill_full_rank(J, 15);
  Eigen::VectorXd first;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    const auto component = registry_.make<LinearSolver>(GetParam());
    auto& solver = *query<JacobianSolver>(*component);
    solver.analyze(structure);
    ASSERT_TRUE(solver.factorize(J, some_damping(structure)).ok);
    const Eigen::VectorXd x = minimize(solver, J);
    if (count == 1) first = x;
    EXPECT_EQ(x, first) << count << " threads";
  }
}

TEST_P(JacobianSolverTest, RefusesCallsOutOfOrder) {
  const JacobianStructure structure = jacobian_structure(BlockStructure({3, 3}, {{1, 0}}));
  const JacobianStructure other = jacobian_structure(BlockStructure({3, 3}, {{1, 0}}));
  JacobianMatrix J(structure), J_other(other);
  fill_full_rank(J, 17);
  fill_full_rank(J_other, 17);
  std::vector<double> x(6);
  EXPECT_THROW(solver().factorize(J, {}), std::logic_error);
  EXPECT_THROW(solver().minimize(J.residual(), x), std::logic_error);
  solver().analyze(structure);
  EXPECT_THROW(solver().minimize(J.residual(), x), std::logic_error);
  ASSERT_TRUE(solver().factorize(J, {}).ok);
  EXPECT_THROW(solver().factorize(J_other, {}), std::logic_error);
}

TEST(Spqr, SaysWhatWouldWorkWhereOnlyHIsAtHand) {
  Registry registry;
  if (!registry.has("linear_solver", "spqr")) GTEST_SKIP();
  const auto solver = registry.make<LinearSolver>("spqr");
  try {
    solver->analyze(BlockStructure({3, 3}, {{1, 0}}));
    FAIL() << "H was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), testing::HasSubstr("use block_cholesky, cholmod or eigen"));
  }
}

}  // namespace
}  // namespace cairn::test
