// SPDX-License-Identifier: BSD-3-Clause
// What is particular to the iterative solvers: their parts, what they report, where they end.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/threads.hpp"
#include "iterative/block_rows.hpp"
#include "iterative/vectors.hpp"
#include "support/block_systems.hpp"
#include "support/dense_algebra.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::span<double> span(Eigen::VectorXd& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}
std::span<const double> span(const Eigen::VectorXd& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}

Eigen::VectorXd random_vector(std::int64_t size, std::uint64_t seed) {
  Random random(seed);
  return Eigen::VectorXd::NullaryExpr(size, [&] { return random(); });
}

/// A long chain of blocks of 3 with loops, several chunks of work long.
BlockStructure long_structure() {
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  constexpr int kBlocks = 3000;
  Random random(5);
  for (int k = 1; k < kBlocks; ++k) entries.emplace_back(k, k - 1);
  for (int k = 0; k < kBlocks; ++k) entries.emplace_back(k, random.below(kBlocks));
  return {std::vector<std::int32_t>(kBlocks, 3), std::move(entries)};
}

/// H with both blocks of its diagonal positive definite, and indefinite all the same.
BlockMatrix indefinite(const BlockStructure& structure) {
  BlockMatrix H(structure);
  for (int j = 0; j < structure.blocks(); ++j) {
    double* diagonal = H.block(structure.column_begin()[j]);
    for (int k = 0; k < structure.block_size(j); ++k) diagonal[k * structure.block_size(j) + k] = 1;
  }
  double* across = H.block(1);  // the entry (1, 0)
  across[0] = 2.0;
  return H;
}

struct Solved {
  Factorization factorization;
  Eigen::VectorXd x;
  LinearSolverStats stats;
};

Solved solve(const std::string& spec, const BlockMatrix& H, const Eigen::VectorXd& g) {
  Registry registry;
  const auto solver = registry.make<LinearSolver>(spec);
  solver->analyze(H.structure());
  Solved solved{
      .factorization = solver->factorize(H), .x = Eigen::VectorXd::Zero(g.size()), .stats = {}};
  if (solved.factorization.ok) solver->solve(span(g), span(solved.x));
  solved.stats = solver->stats();
  return solved;
}

/// ½ xᵀHx − gᵀx, which every step that is used must lower.
double model(const BlockMatrix& H, const Eigen::VectorXd& g, const Eigen::VectorXd& x) {
  return 0.5 * x.dot(dense(H) * x) - g.dot(x);
}

TEST(BlockRows, MultiplyAsTheMatrixDoes) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    BlockMatrix H(sample.structure);
    fill_positive_definite(H, 1);
    iterative::BlockRows rows;
    rows.analyze(sample.structure);
    rows.load(H);
    const Eigen::VectorXd x = random_vector(sample.structure.size(), 2);
    Eigen::VectorXd y(x.size()), expected(x.size());
    const double product = rows.multiply_dot(span(x), span(y));
    H.multiply(span(x), span(expected));
    EXPECT_LE((y - expected).norm(), 1e-14 * expected.norm());
    EXPECT_NEAR(product, x.dot(y), 1e-12 * (1.0 + std::abs(product)));
    for (int i = 0; i < sample.structure.blocks(); ++i) {
      const std::int64_t first = sample.structure.offsets()[i], n = sample.structure.block_size(i);
      const Eigen::Map<const Eigen::MatrixXd> own(H.block(sample.structure.column_begin()[i]), n,
                                                  n);
      Eigen::VectorXd rest = expected.segment(first, n) - own * x.segment(first, n);
      rows.subtract_neighbours(i, x.data(), rest.data());
      EXPECT_LE(rest.norm(), 1e-12 * (1.0 + expected.norm()));
    }
  }
}

class IterativeSolverTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (!Registry().has("linear_solver", parse_component(GetParam()).name)) GTEST_SKIP();
  }
  void TearDown() override { set_threads(0); }
  /// The spec with another option.
  static std::string with(const std::string& option) {
    const char separator = GetParam().find(':') == std::string::npos ? ':' : ',';
    return GetParam() + separator + option;
  }
};
INSTANTIATE_TEST_SUITE_P(Each, IterativeSolverTest,
                         testing::Values("pcg:preconditioner=block_jacobi",
                                         "pcg:preconditioner=incomplete_cholesky",
                                         "pcg:preconditioner=subgraph", "jacobi", "gauss_seidel"),
                         [](const auto& test) {
                           std::string name = test.param;
                           return name.substr(
                               name.find('=') == std::string::npos ? 0 : name.find('=') + 1);
                         });

TEST_P(IterativeSolverTest, SaysThatItIsIterativeAndToWhichTolerance) {
  Registry registry;
  const auto solver = registry.make<LinearSolver>(with("tolerance=1e-5"));
  const auto* iterative = query<IterativeSolver>(*solver);
  ASSERT_TRUE(iterative);
  EXPECT_EQ(iterative->tolerance(), 1e-5);
  if (!registry.has("linear_solver", "schur")) return;
  if (GetParam().find(':') != std::string::npos) return;  // options of an option cannot be written
  const auto schur = registry.make<LinearSolver>("schur:linear_solver=" + GetParam());
  EXPECT_TRUE(query<IterativeSolver>(*schur)) << "exact where its inner solver is";
}

TEST_P(IterativeSolverTest, ReachesWhicheverToleranceIsAsked) {
  const BlockStructure structure = sample_structures()[9].structure;  // a grid
  BlockMatrix H(structure);
  fill_positive_definite(H, 3);
  const Eigen::VectorXd g = random_vector(structure.size(), 4);
  std::int64_t iterations = 0;
  for (const double tolerance : {1e-2, 1e-6, 1e-12}) {
    const Solved solved =
        solve(with("tolerance=" + std::to_string(tolerance * 1e12) + "e-12"), H, g);
    ASSERT_TRUE(solved.factorization.ok);
    const double residual = (dense(H) * solved.x - g).norm() / g.norm();
    EXPECT_LE(residual, tolerance * 1.01);
    EXPECT_NEAR(solved.stats.relative_residual, residual, 1e-3 * tolerance) << "reports another";
    EXPECT_GT(solved.stats.iterations, iterations);
    EXPECT_THAT(solved.stats.note, Not(HasSubstr("above the tolerance")));
    iterations = solved.stats.iterations;
  }
}

TEST_P(IterativeSolverTest, UsesWhatItHasAtTheLimitAndSaysSo) {
  const BlockStructure structure = sample_structures()[9].structure;
  BlockMatrix H(structure);
  fill_positive_definite(H, 3);
  const Eigen::VectorXd g = random_vector(structure.size(), 4);
  const double lowest = model(H, g, dense_solution(dense(H), g));
  double before = 0.0;
  for (const int limit : {1, 2, 4}) {
    const Solved solved = solve(with("max_iterations=" + std::to_string(limit)), H, g);
    EXPECT_EQ(solved.stats.iterations, limit);
    EXPECT_GT(solved.stats.relative_residual, 1e-10);
    EXPECT_THAT(solved.stats.note, HasSubstr("1 of 1 solves stopped by max_iterations"));
    const double now = model(H, g, solved.x);
    EXPECT_LT(now, before) << "no step that descends";
    EXPECT_GT(now, lowest);
    before = now;
  }
}

TEST_P(IterativeSolverTest, CountsFromTheAnalysisOn) {
  Registry registry;
  const auto solver = registry.make<LinearSolver>(GetParam());
  const BlockStructure structure = sample_structures()[9].structure;
  BlockMatrix H(structure);
  fill_positive_definite(H, 3);
  solver->analyze(structure);
  EXPECT_EQ(solver->stats().iterations, 0);
  ASSERT_TRUE(solver->factorize(H).ok);
  const Eigen::VectorXd g = random_vector(structure.size(), 4);
  Eigen::VectorXd x(g.size());
  solver->solve(span(g), span(x));
  const std::int64_t once = solver->stats().iterations;
  EXPECT_GT(once, 0);
  solver->solve(span(g), span(x));
  EXPECT_EQ(solver->stats().iterations, 2 * once);
  solver->analyze(structure);
  EXPECT_EQ(solver->stats().iterations, 0);
  EXPECT_EQ(solver->stats().relative_residual, 0.0);
}

TEST_P(IterativeSolverTest, AnswersNothingWithNothing) {
  const BlockStructure structure = sample_structures()[3].structure;
  BlockMatrix H(structure);
  fill_positive_definite(H, 3);
  const Solved solved = solve(GetParam(), H, Eigen::VectorXd::Zero(structure.size()));
  EXPECT_EQ(solved.x.norm(), 0.0);
  EXPECT_EQ(solved.stats.iterations, 0);
}

TEST_P(IterativeSolverTest, TellsOfAnIndefiniteMatrixAndStaysFinite) {
  const BlockStructure structure({2, 2}, {{1, 0}});
  const BlockMatrix H = indefinite(structure);
  // The diagonal blocks do not show it; g has a part along the negative direction.
  const Eigen::VectorXd g = (Eigen::VectorXd(4) << 1.0, 0.5, -1.0, 0.25).finished();
  const Solved solved = solve(GetParam(), H, g);
  if (!solved.factorization.ok) return;  // told at once
  EXPECT_TRUE(solved.x.allFinite());
  EXPECT_LE(model(H, g, solved.x), 0.0);
  EXPECT_THAT(solved.stats.note,
              testing::AnyOf(HasSubstr("in which H is not positive"), HasSubstr("diverged")));
}

TEST_P(IterativeSolverTest, GivesTheSameBitsForAnyNumberOfThreadsOnManyChunks) {
  const BlockStructure structure = long_structure();
  BlockMatrix H(structure);
  fill_positive_definite(H, 7);
  const Eigen::VectorXd g = random_vector(structure.size(), 8);
  Eigen::VectorXd first;
  std::int64_t iterations = 0;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    const Solved solved = solve(with("max_iterations=40"), H, g);
    if (count == 1) {
      first = solved.x;
      iterations = solved.stats.iterations;
    }
    EXPECT_EQ(solved.x, first) << count << " threads";
    EXPECT_EQ(solved.stats.iterations, iterations);
  }
}

TEST(Dot, GivesTheSameBitsForAnyNumberOfThreads) {
  const Eigen::VectorXd a = random_vector(100000, 1), b = random_vector(100000, 2);
  double first = 0.0;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    const double now = iterative::dot(span(a), span(b));
    if (count == 1) first = now;
    EXPECT_EQ(now, first) << count;
  }
  set_threads(0);
  EXPECT_NEAR(first, a.dot(b), 1e-10);
}

/// H of one factor on all of five unknowns and weak priors: the largest eigenvalue of D⁻¹H is
/// nearly 5.
BlockMatrix one_wide_factor(const BlockStructure& structure) {
  BlockMatrix H(structure);
  for (double& value : H.values()) value = 1.0;
  for (int j = 0; j < structure.blocks(); ++j) H.block(structure.column_begin()[j])[0] += 0.1;
  return H;
}

BlockStructure five_scalars() {
  return {{1, 1, 1, 1, 1},
          {{1, 0}, {2, 0}, {3, 0}, {4, 0}, {2, 1}, {3, 1}, {4, 1}, {3, 2}, {4, 2}, {4, 3}}};
}

TEST(Jacobi, ChoosesADampingThatConverges) {
  if (!Registry().has("linear_solver", "jacobi")) GTEST_SKIP();
  const BlockStructure structure = five_scalars();
  const BlockMatrix H = one_wide_factor(structure);
  const Eigen::VectorXd g = random_vector(5, 3);
  const Solved solved = solve("jacobi", H, g);
  EXPECT_LE((dense(H) * solved.x - g).norm(), 1.01e-10 * g.norm());
}

TEST(Jacobi, SaysThatItDivergesAndReturnsTheBest) {
  if (!Registry().has("linear_solver", "jacobi")) GTEST_SKIP();
  const BlockStructure structure = five_scalars();
  const BlockMatrix H = one_wide_factor(structure);
  const Eigen::VectorXd g = random_vector(5, 3);
  const Solved solved = solve("jacobi:omega=1", H, g);
  EXPECT_THAT(solved.stats.note, HasSubstr("diverged"));
  EXPECT_TRUE(solved.x.allFinite());
  EXPECT_LE(model(H, g, solved.x), 0.0);
}

TEST(GaussSeidel, NeedsFewerSweepsThanJacobi) {
  Registry registry;
  if (!registry.has("linear_solver", "jacobi") || !registry.has("linear_solver", "gauss_seidel"))
    GTEST_SKIP();
  const BlockStructure structure = sample_structures()[9].structure;
  BlockMatrix H(structure);
  fill_positive_definite(H, 3);
  const Eigen::VectorXd g = random_vector(structure.size(), 4);
  EXPECT_LT(solve("gauss_seidel", H, g).stats.iterations, solve("jacobi", H, g).stats.iterations);
}

}  // namespace
}  // namespace cairn::test
