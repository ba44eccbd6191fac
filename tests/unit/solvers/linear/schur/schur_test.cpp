// SPDX-License-Identifier: BSD-3-Clause
// What the Schur complement owes beyond what every linear solver does (linear_solver_test.cpp).
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/block_systems.hpp"
#include "support/dense_algebra.hpp"
#include "support/sample_graphs.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

using testing::StartsWith;

using Sizes = std::vector<std::int32_t>;
using Entries = std::vector<std::pair<std::int32_t, std::int32_t>>;

class SchurTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry_.has("linear_solver", "schur") || !registry_.has("linear_solver", "eigen"))
      GTEST_SKIP() << "needs the plugins schur and eigen";
  }
  void TearDown() override { set_threads(0); }

  /// `options`: as "eliminate=smallest,…", with `eigen` for the reduced system where they name
  /// none.
  std::unique_ptr<LinearSolver> schur(const std::string& options = "") {
    const bool named = options.find("linear_solver=") != std::string::npos;
    std::string spec = named ? "schur:" : "schur:linear_solver=eigen,";
    return registry_.make<LinearSolver>(spec + (options.empty() ? "eliminate=auto" : options));
  }
  std::vector<std::string> kernel_sets() {
    std::vector<std::string> sets;
    for (const char* name : {"portable", "avx2", "avx512"}) {
      try {
        schur("kernels=" + std::string(name));
        sets.emplace_back(name);
      } catch (const Error&) {  // not on this machine
      }
    }
    return sets;
  }
  /// The names of the solvers that can solve the reduced system.
  std::vector<std::string> inner_solvers() {
    std::vector<std::string> names;
    for (const std::string& name : registry_.names("linear_solver")) {
      if (name == "schur" && !registry_.has("linear_solver", "block_cholesky")) continue;
      if (!query<JacobianSolver>(*registry_.make<LinearSolver>(name))) names.push_back(name);
    }
    return names;
  }

  Registry registry_;
};

/// Remaining blocks in a chain, and blocks to eliminate, each joined with `seen_by` of them; in
/// that order, the other way round, or by turns.
enum class Layout { remaining_first, eliminated_first, mixed };
BlockStructure bipartite(const Sizes& remaining, const Sizes& eliminated, int seen_by,
                         Layout layout) {
  const int r = static_cast<int>(remaining.size()), e = static_cast<int>(eliminated.size());
  std::vector<std::int32_t> number(r + e);
  std::iota(number.begin(), number.end(), 0);
  if (layout == Layout::eliminated_first)
    std::rotate(number.begin(), number.begin() + e, number.end());
  if (layout == Layout::mixed) {
    Random random(5);
    for (int k = r + e - 1; k > 0; --k) std::swap(number[k], number[random.below(k + 1)]);
  }
  Sizes sizes(r + e);
  Entries entries;
  for (int k = 0; k < r; ++k) {
    sizes[number[k]] = remaining[k];
    if (k > 0) entries.emplace_back(number[k], number[k - 1]);
  }
  Random random(6);
  for (int k = 0; k < e; ++k) {
    sizes[number[r + k]] = eliminated[k];
    const int first = random.below(r);
    for (int s = 0; s < seen_by; ++s) entries.emplace_back(number[r + k], number[(first + s) % r]);
  }
  return {sizes, entries};
}

Eigen::VectorXd right_hand_side(std::int64_t size) {
  Random random(7);
  return Eigen::VectorXd::NullaryExpr(size, [&] { return random(); });
}

Eigen::VectorXd solve(LinearSolver& solver, const Eigen::VectorXd& g) {
  Eigen::VectorXd x(g.size());
  solver.solve({g.data(), static_cast<std::size_t>(g.size())},
               {x.data(), static_cast<std::size_t>(x.size())});
  return x;
}

void expect_agreement(LinearSolver& solver, const BlockStructure& structure,
                      double tolerance = 1e-10) {
  BlockMatrix H(structure);
  fill_positive_definite(H, 1);
  solver.analyze(structure);
  ASSERT_TRUE(solver.factorize(H).ok);
  const Eigen::VectorXd g = right_hand_side(structure.size());
  const Eigen::VectorXd expected = dense_solution(dense(H), g);
  EXPECT_LE((solve(solver, g) - expected).norm(), tolerance * expected.norm());
}

TEST_F(SchurTest, AgreesWithDenseAlgebraForEveryPairOfSizesAndKernelSet) {
  for (const std::string& kernels : kernel_sets()) {
    for (const std::int32_t small : {1, 2, 3, 4, 6}) {
      for (const std::int32_t large : {7, 9, 10, 6, 3, 2}) {
        if (large <= small) continue;
        SCOPED_TRACE(testing::Message() << kernels << ' ' << large << " × " << small);
        const auto solver = schur("eliminate=smallest,kernels=" + kernels);
        expect_agreement(*solver, bipartite(Sizes(5, large), Sizes(12, small), 3, Layout::mixed));
        EXPECT_THAT(solver->stats().ordering, StartsWith("schur(12 eliminated)+"));
      }
    }
  }
}

TEST_F(SchurTest, TakesBlocksOfManySizesInAnyOrder) {
  for (const Layout layout : {Layout::remaining_first, Layout::eliminated_first, Layout::mixed}) {
    for (const std::string& kernels : kernel_sets()) {
      const BlockStructure structure = bipartite({9, 6, 3, 9, 2, 6, 7, 3}, Sizes(30, 2), 4, layout);
      expect_agreement(*schur("eliminate=smallest,kernels=" + kernels), structure);
      const BlockStructure several =
          bipartite({9, 6, 9, 9, 9, 6, 9, 9}, {3, 2, 3, 3, 2, 1, 3, 6, 2, 3, 9, 4}, 3, layout);
      expect_agreement(*schur("eliminate=independent_set,kernels=" + kernels), several);
    }
  }
}

TEST_F(SchurTest, LeavesTheRestToAnySolver) {
  const BlockStructure structure = bipartite(Sizes(8, 6), Sizes(40, 3), 3, Layout::mixed);
  for (const std::string& inner : inner_solvers()) {
    SCOPED_TRACE(inner);
    const auto solver = schur("linear_solver=" + inner);
    expect_agreement(*solver, structure);
    EXPECT_THAT(solver->stats().ordering, StartsWith("schur(40 eliminated)+"));
  }
}

// Steps of an optimizer alone: of a reduced system that is dense and large.
TEST_F(SchurTest, SolvesALargeDenseReducedSystemAsExactlyAsIsAskedFor) {
  if (!registry_.has("linear_solver", "pcg")) GTEST_SKIP() << "needs the plugin pcg";
  const auto solver = schur("linear_solver=eigen,dense=pcg,eliminate=smallest");
  EXPECT_EQ(query<LogDeterminant>(*solver), nullptr);
  const BlockStructure small = bipartite(Sizes(8, 9), Sizes(40, 3), 8, Layout::mixed);
  expect_agreement(*solver, small);
  EXPECT_EQ(query<IterativeSolver>(*solver), nullptr) << "solved directly";
  const BlockStructure large = bipartite(Sizes(280, 9), Sizes(4, 3), 280, Layout::mixed);
  BlockMatrix H(large);
  fill_positive_definite(H, 1);
  solver->analyze(large);
  ASSERT_TRUE(solver->factorize(H).ok);
  const auto direct = schur("eliminate=smallest");
  direct->analyze(large);
  ASSERT_TRUE(direct->factorize(H).ok);
  const Eigen::VectorXd g = right_hand_side(large.size()), expected = solve(*direct, g);
  auto* iterative = query<IterativeSolver>(*solver);
  ASSERT_NE(iterative, nullptr);
  EXPECT_LE((solve(*solver, g) - expected).norm(), 1e-8 * expected.norm());
  const std::int64_t exact = solver->stats().iterations;
  EXPECT_TRUE(iterative->set_forcing(0.05));
  EXPECT_LE((solve(*solver, g) - expected).norm(), 0.3 * expected.norm());
  EXPECT_LT(2 * (solver->stats().iterations - exact), exact);
}

TEST_F(SchurTest, EliminatesEverythingWhereNothingIsJoined) {
  const BlockStructure structure({3, 6, 1, 3, 9}, {});
  const auto solver = schur("eliminate=independent_set");
  expect_agreement(*solver, structure);
  EXPECT_EQ(solver->stats().ordering, "schur(5 eliminated)");
}

TEST_F(SchurTest, TakesAnEmptySystem) {
  const BlockStructure structure({}, {});
  const BlockMatrix H(structure);
  const auto solver = schur();
  solver->analyze(structure);
  EXPECT_TRUE(solver->factorize(H).ok);
  solver->solve({}, {});
}

TEST_F(SchurTest, ChoosesPointsWhereTheyAreManyAndElseAnIndependentSet) {
  const auto eliminated = [&](const std::string& how, const BlockStructure& structure) {
    const auto solver = schur("eliminate=" + how);
    solver->analyze(structure);
    return solver->stats().ordering.substr(0, solver->stats().ordering.find(')'));
  };
  const BlockStructure many = bipartite(Sizes(10, 6), Sizes(50, 3), 3, Layout::mixed);
  EXPECT_EQ(eliminated("auto", many), "schur(50 eliminated");
  const BlockStructure few = bipartite(Sizes(50, 3), Sizes(5, 2), 8, Layout::mixed);
  EXPECT_EQ(eliminated("smallest", few), "schur(5 eliminated");
  EXPECT_NE(eliminated("auto", few), "schur(5 eliminated");
  Entries chain;
  for (int k = 1; k < 21; ++k) chain.emplace_back(k, k - 1);
  const BlockStructure poses(Sizes(21, 3), chain);
  EXPECT_EQ(eliminated("auto", poses), "schur(11 eliminated") << "both ends, and every other";
  EXPECT_EQ(eliminated("smallest", poses), "schur(11 eliminated");
}

TEST_F(SchurTest, LeavesAHubInPlace) {
  // A star whose points are themselves joined in pairs with one that has fewer neighbours: every
  // neighbour of the hub is barred, and yet it must stay.
  Entries entries;
  const int arms = 20, hub = 0;
  for (int k = 0; k < arms; ++k) {
    entries.emplace_back(1 + 2 * k, hub);
    entries.emplace_back(2 + 2 * k, 1 + 2 * k);
  }
  const BlockStructure structure(Sizes(1 + 2 * arms, 3), entries);
  const auto solver = schur("eliminate=independent_set");
  solver->analyze(structure);
  EXPECT_THAT(solver->stats().ordering, StartsWith("schur(20 eliminated)"));
}

TEST_F(SchurTest, GivesTheSameBitsForAnyNumberOfThreads) {
  const BlockStructure structure = bipartite(Sizes(40, 9), Sizes(1500, 3), 6, Layout::mixed);
  BlockMatrix H(structure);
  fill_positive_definite(H, 3);
  const Eigen::VectorXd g = right_hand_side(structure.size());
  for (const std::string& kernels : kernel_sets()) {
    Eigen::VectorXd first;
    for (const int count : {1, 2, 3}) {
      set_threads(count);
      const auto solver = schur("kernels=" + kernels);
      solver->analyze(structure);
      ASSERT_TRUE(solver->factorize(H).ok);
      const Eigen::VectorXd x = solve(*solver, g);
      if (count == 1) first = x;
      EXPECT_EQ(x, first) << count << " threads, " << kernels;
    }
  }
}

TEST_F(SchurTest, NamesTheBlockThatFailedInTheNumbersOfTheWhole) {
  const BlockStructure structure = bipartite(Sizes(6, 6), Sizes(20, 3), 3, Layout::mixed);
  const auto solver = schur();
  solver->analyze(structure);
  for (int bad = 0; bad < structure.blocks(); ++bad) {
    BlockMatrix H(structure);
    fill_positive_definite(H, 4);
    H.block(structure.column_begin()[bad])[0] = -1e6;
    const Factorization factorization = solver->factorize(H);
    EXPECT_FALSE(factorization.ok);
    EXPECT_EQ(factorization.failed_block, bad);
    std::vector<double> x(structure.size());
    EXPECT_THROW(solver->solve(x, x), std::logic_error);
  }
}

/// Scalars in the factor of a matrix whose blocks are eliminated in that order.
std::int64_t nonzeros(const BlockStructure& structure, std::span<const std::int32_t> order) {
  std::vector<std::set<std::int32_t>> joined(structure.blocks());
  for (std::int32_t j = 0; j < structure.blocks(); ++j) {
    for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
         ++e) {
      joined[j].insert(structure.rows()[e]);
      joined[structure.rows()[e]].insert(j);
    }
  }
  std::int64_t count = 0;
  for (const std::int32_t block : order) {
    const std::int64_t size = structure.block_size(block);
    count += size * (size + 1) / 2;
    for (const std::int32_t other : joined[block]) {
      count += size * structure.block_size(other);
      joined[other].erase(block);
      for (const std::int32_t third : joined[block]) {
        if (third != other) joined[other].insert(third);
      }
    }
  }
  return count;
}

TEST_F(SchurTest, TellsTheOrderAndTheSizeOfTheWholeFactor) {
  if (!registry_.has("linear_solver", "block_cholesky")) GTEST_SKIP() << "needs block_cholesky";
  const BlockStructure structure = bipartite(Sizes(9, 6), Sizes(30, 3), 2, Layout::mixed);
  const auto solver = schur("linear_solver=block_cholesky");
  solver->analyze(structure);
  auto* ability = query<EliminationOrder>(*solver);
  ASSERT_NE(ability, nullptr);
  const std::vector<std::int32_t> order(ability->elimination_order().begin(),
                                        ability->elimination_order().end());
  std::vector<std::int32_t> all(structure.blocks());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_THAT(order, testing::UnorderedElementsAreArray(all));
  for (int k = 0; k < 30; ++k) EXPECT_EQ(structure.block_size(order[k]), 3) << k;
  EXPECT_EQ(solver->stats().factor_nonzeros, nonzeros(structure, order));
}

TEST_F(SchurTest, SolvesManyRightHandSidesAsItSolvesOne) {
  if (!registry_.has("linear_solver", "block_cholesky")) GTEST_SKIP() << "needs block_cholesky";
  for (const BlockStructure& structure :
       {bipartite(Sizes(12, 9), Sizes(50, 3), 4, Layout::mixed), BlockStructure({3, 2, 6}, {})}) {
    BlockMatrix H(structure);
    fill_positive_definite(H, 8);
    const auto solver = schur("linear_solver=block_cholesky");
    auto* ability = query<ManyRightHandSides>(*solver);
    ASSERT_NE(ability, nullptr);
    solver->analyze(structure);
    Eigen::MatrixXd G = Eigen::MatrixXd::Identity(structure.size(), structure.size());
    const std::span<double> both(G.data(), static_cast<std::size_t>(G.size()));
    EXPECT_THROW(ability->solve(both, both, static_cast<int>(G.cols())), std::logic_error);
    ASSERT_TRUE(solver->factorize(H).ok);
    ability->solve(both, both, static_cast<int>(G.cols()));
    for (Eigen::Index k = 0; k < G.cols(); ++k) {
      const Eigen::VectorXd one = solve(*solver, Eigen::VectorXd::Unit(G.rows(), k));
      EXPECT_LE((G.col(k) - one).norm(), 1e-13 * one.norm()) << k;
    }
  }
}

TEST_F(SchurTest, HasOnlyTheAbilitiesOfTheInnerSolver) {
  const auto solver = schur("linear_solver=eigen");
  EXPECT_NE(query<LogDeterminant>(*solver), nullptr);
  EXPECT_EQ(query<EliminationOrder>(*solver), nullptr);
  EXPECT_EQ(query<ManyRightHandSides>(*solver), nullptr);
}

TEST_F(SchurTest, ReachesTheMinimumOfAGraphWithLandmarks) {
  if (!registry_.has("optimizer", "gauss_newton")) GTEST_SKIP() << "needs gauss_newton";
  const double minimum = dense_minimum(poses_and_points(40, 0.05));
  for (const char* how : {"auto", "smallest", "independent_set"}) {
    Graph graph = poses_and_points(40, 0.05);
    const auto optimizer = registry_.make<Optimizer>(ComponentSpec{
        "gauss_newton",
        {{"linear_solver", "schur:linear_solver=eigen,eliminate=" + std::string(how)}}});
    const Summary summary = optimizer->optimize(graph);
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_NEAR(summary.final_chi2, minimum, 1e-9 * minimum) << how;
  }
}

}  // namespace
}  // namespace cairn::test
