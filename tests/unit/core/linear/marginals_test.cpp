// SPDX-License-Identifier: BSD-3-Clause
// What every linear solver owes that says it can give covariances, whoever wrote it.
#include "cairn/linear/marginals.hpp"

#include <array>
#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/block_systems.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/sample_graphs.hpp"
#include "support/sample_jacobians.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

using Pairs = std::vector<std::pair<std::int32_t, std::int32_t>>;

std::vector<std::string> solvers_with_marginals() {
  Registry registry;
  std::vector<std::string> specs = every_component("linear_solver");
  std::erase_if(specs, [&](const std::string& spec) {
    return !query<Marginals>(*registry.make<LinearSolver>(spec));
  });
  return specs;
}

class MarginalsTest : public testing::TestWithParam<std::string> {
 protected:
  void TearDown() override { set_threads(0); }

  /// Factorises something on that structure; returns its inverse.
  Eigen::MatrixXd prepare(const BlockStructure& structure, std::uint64_t seed) {
    if (auto* of_jacobian = query<JacobianSolver>(*solver_)) {
      jacobian_ = jacobian_structure(structure);
      JacobianMatrix J(jacobian_);
      fill_full_rank(J, seed);
      of_jacobian->analyze(jacobian_);
      EXPECT_TRUE(of_jacobian->factorize(J, {}).ok);
      const Eigen::MatrixXd D = dense(J);
      return symmetric_inverse(D.transpose() * D);
    }
    BlockMatrix H(structure);
    fill_positive_definite(H, seed);
    solver_->analyze(structure);
    EXPECT_TRUE(solver_->factorize(H).ok);
    return symmetric_inverse(dense(H));
  }
  Marginals& marginals() { return *query<Marginals>(*solver_); }

  Registry registry_;
  std::unique_ptr<LinearSolver> solver_ = registry_.make<LinearSolver>(GetParam());
  JacobianStructure jacobian_;
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MarginalsTest);
INSTANTIATE_TEST_SUITE_P(Registered, MarginalsTest, testing::ValuesIn(solvers_with_marginals()),
                         test_name);

std::int64_t doubles(const BlockStructure& s, const Pairs& pairs) {
  std::int64_t count = 0;
  for (const auto& [i, j] : pairs) count += std::int64_t{s.block_size(i)} * s.block_size(j);
  return count;
}

void expect_blocks(const BlockStructure& s, const Pairs& pairs, const std::vector<double>& values,
                   const Eigen::MatrixXd& Sigma) {
  const double* next = values.data();
  for (const auto& [i, j] : pairs) {
    const Eigen::Map<const Eigen::MatrixXd> block(next, s.block_size(i), s.block_size(j));
    const Eigen::MatrixXd expected =
        Sigma.block(s.offsets()[i], s.offsets()[j], s.block_size(i), s.block_size(j));
    EXPECT_LE((block - expected).norm(), 1e-9 * Sigma.norm()) << i << ' ' << j;
    next += block.size();
  }
}

Pairs diagonal_of(const BlockStructure& s) {
  Pairs pairs;
  for (int b = 0; b < s.blocks(); ++b) pairs.emplace_back(b, b);
  return pairs;
}

TEST_P(MarginalsTest, GivesEveryDiagonalBlock) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const Eigen::MatrixXd Sigma = prepare(sample.structure, 21);
    const Pairs pairs = diagonal_of(sample.structure);
    std::vector<double> blocks(doubles(sample.structure, pairs));
    marginals().diagonal_blocks(blocks);
    expect_blocks(sample.structure, pairs, blocks, Sigma);
  }
}

TEST_P(MarginalsTest, GivesBlockColumns) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const BlockStructure& s = sample.structure;
    const Eigen::MatrixXd Sigma = prepare(s, 22);
    for (const int b : {0, s.blocks() / 2, s.blocks() - 1}) {
      Eigen::MatrixXd column(s.size(), s.block_size(b));
      marginals().block_column(b, {column.data(), static_cast<std::size_t>(column.size())});
      EXPECT_LE((column - Sigma.middleCols(s.offsets()[b], s.block_size(b))).norm(),
                1e-9 * Sigma.norm());
    }
  }
}

/// Few and many, of the pattern and beyond it, either way round, and twice.
TEST_P(MarginalsTest, GivesAnyBlocksBeforeAndAfterTheDiagonalOnes) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const BlockStructure& s = sample.structure;
    const Eigen::MatrixXd Sigma = prepare(s, 23);
    const int last = s.blocks() - 1;
    const Pairs few{{0, last}};
    Pairs many{{last, 0}, {0, 0}, {0, last}, {0, last}};
    Random random(24);
    for (int k = 0; k < 3 * s.blocks(); ++k)
      many.emplace_back(random.below(s.blocks()), random.below(s.blocks()));
    Pairs one_row;
    for (int b = 0; b <= last; ++b) one_row.emplace_back(last / 2, b);
    const auto check = [&](const Pairs& pairs) {
      std::vector<double> blocks(doubles(s, pairs));
      marginals().blocks(pairs, blocks);
      expect_blocks(s, pairs, blocks, Sigma);
    };
    check({});
    check(few);
    check(one_row);
    check(many);
    std::vector<double> diagonal(doubles(s, diagonal_of(s)));
    marginals().diagonal_blocks(diagonal);
    check(few);
    check(many);
  }
}

TEST_P(MarginalsTest, AreThoseOfTheLastFactorisation) {
  const BlockStructure structure = sample_structures()[10].structure;
  const Pairs pairs = diagonal_of(structure);
  for (const std::uint64_t seed : {25, 26}) {
    const Eigen::MatrixXd Sigma = prepare(structure, seed);
    std::vector<double> blocks(doubles(structure, pairs));
    marginals().diagonal_blocks(blocks);
    expect_blocks(structure, pairs, blocks, Sigma);
  }
  if (query<JacobianSolver>(*solver_)) return;
  BlockMatrix H(structure);
  fill_positive_definite(H, 27);
  ASSERT_TRUE(solver_->factorize(H).ok);  // without a new analysis
  std::vector<double> blocks(doubles(structure, pairs));
  marginals().diagonal_blocks(blocks);
  expect_blocks(structure, pairs, blocks, symmetric_inverse(dense(H)));
}

TEST_P(MarginalsTest, GivesTheSameBitsForAnyNumberOfThreads) {
  const BlockStructure structure = sample_structures()[10].structure;
  const Pairs pairs = diagonal_of(structure);
  std::vector<double> first;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    solver_ = registry_.make<LinearSolver>(GetParam());
    prepare(structure, 28);
    std::vector<double> blocks(doubles(structure, pairs));
    marginals().diagonal_blocks(blocks);
    if (first.empty()) first = blocks;
    EXPECT_EQ(blocks, first) << count << " threads";
  }
}

TEST_P(MarginalsTest, RefusesCallsOutOfOrderAndRoomOfAnotherSize) {
  const BlockStructure structure({3, 3}, {{1, 0}});
  std::vector<double> two(18), column(18), one(9);
  const Pairs pair{{0, 1}};
  if (!query<JacobianSolver>(*solver_)) {
    solver_->analyze(structure);
    EXPECT_THROW(marginals().diagonal_blocks(two), std::logic_error);
    EXPECT_THROW(marginals().block_column(0, column), std::logic_error);
    EXPECT_THROW(marginals().blocks(pair, one), std::logic_error);
  }
  prepare(structure, 29);
  EXPECT_THROW(marginals().diagonal_blocks(one), std::logic_error);
  EXPECT_THROW(marginals().block_column(0, one), std::logic_error);
  EXPECT_THROW(marginals().blocks(pair, std::span(one).first(8)), std::logic_error);
  EXPECT_NO_THROW(marginals().blocks(pair, one));
}

TEST(Marginals, AreNotPromisedByWhatOnlyApproximates) {
  Registry registry;
  for (const std::string& name : every_component("linear_solver")) {
    const auto solver = registry.make<LinearSolver>(name);
    const bool approximates = name.find("pcg") != std::string::npos ||
                              name.find("jacobi") != std::string::npos ||
                              name.find("gauss_seidel") != std::string::npos;
    EXPECT_EQ(query<Marginals>(*solver) != nullptr, !approximates) << name;
  }
}

// Of a graph
// ---------------------------------------------------------------------------------------

/// Σ over all variables, zeros where they are held, by dense algebra.
Eigen::MatrixXd dense_covariance(const Graph& graph) {
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(linearizer.structure().size());
  linearizer.linearize(graph.values(), H, g);
  const Eigen::MatrixXd of_blocks = symmetric_inverse(dense(H));
  std::vector<std::int64_t> from, to;
  std::int64_t row = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const int block = linearizer.block_of(v);
    for (int k = 0; k < graph.type(v).tangent_size(); ++k, ++row) {
      if (block < 0) continue;
      from.push_back(linearizer.structure().offsets()[block] + k);
      to.push_back(row);
    }
  }
  Eigen::MatrixXd Sigma = Eigen::MatrixXd::Zero(row, row);
  Sigma(to, to) = of_blocks(from, from);
  return Sigma;
}

std::vector<std::int64_t> rows_of(const Graph& graph) {
  std::vector<std::int64_t> begin{0};
  for (int v = 0; v < graph.variable_count(); ++v)
    begin.push_back(begin.back() + graph.type(v).tangent_size());
  return begin;
}

TEST_P(MarginalsTest, OfAGraphAreThoseOfHWithoutDampingAtItsStates) {
  for (Graph& graph : std::array{ring_of_poses(20, 0.02), poses_and_points(12, 0.02)}) {
    ComponentSpec spec{"levenberg_marquardt", {{"linear_solver", GetParam()}}};
    registry_.make<Optimizer>(spec)->optimize(graph);
    const Eigen::MatrixXd Sigma = dense_covariance(graph);
    const std::vector<std::int64_t> rows = rows_of(graph);
    const auto block = [&](int i, int j) {
      return Eigen::MatrixXd(
          Sigma.block(rows[i], rows[j], rows[i + 1] - rows[i], rows[j + 1] - rows[j]));
    };
    GraphMarginals marginals(graph, *solver_);
    ASSERT_TRUE(marginals.factorize().ok);
    std::vector<std::pair<int, int>> pairs, diagonal;
    for (int v = 0; v < graph.variable_count(); ++v) {
      diagonal.emplace_back(v, v);
      pairs.emplace_back(v, graph.variable_count() - 1 - v);
      pairs.emplace_back(0, v);  // the anchor is held: zeros
    }
    const auto check = [&](const auto& of, const std::vector<double>& values) {
      const double* next = values.data();
      for (const auto& [i, j] : of) {
        const Eigen::MatrixXd expected = block(i, j);
        const Eigen::Map<const Eigen::MatrixXd> found(next, expected.rows(), expected.cols());
        EXPECT_LE((found - expected).norm(), 1e-9 * Sigma.norm()) << i << ' ' << j;
        next += expected.size();
      }
      EXPECT_EQ(next, values.data() + values.size());
    };
    check(diagonal, marginals.diagonal());
    check(pairs, marginals.blocks(pairs));
    const int last = graph.variable_count() - 1;
    const std::vector<double> column = marginals.column(last);
    const Eigen::MatrixXd expected = Sigma.middleCols(rows[last], rows[last + 1] - rows[last]);
    EXPECT_LE((Eigen::Map<const Eigen::MatrixXd>(column.data(), expected.rows(), expected.cols()) -
               expected)
                  .norm(),
              1e-9 * Sigma.norm());
    EXPECT_THAT(marginals.column(0), testing::Each(0.0));
  }
}

TEST_P(MarginalsTest, AreZeroWhereEverythingIsHeld) {
  const Graph graph = everything_held();
  GraphMarginals marginals(graph, *solver_);
  EXPECT_TRUE(marginals.factorize().ok);
  EXPECT_THAT(marginals.diagonal(), testing::Each(0.0));
  EXPECT_THAT(marginals.column(1), testing::Each(0.0));
}

TEST_P(MarginalsTest, OfAGraphNeedAFactorisation) {
  const Graph graph = ring_of_poses(5, 0.1);
  GraphMarginals marginals(graph, *solver_);
  EXPECT_THROW(marginals.diagonal(), std::logic_error);
  ASSERT_TRUE(marginals.factorize().ok);
  EXPECT_FALSE(marginals.diagonal().empty());
}

// Where rounding takes the digits of a covariance there is none; those that work on the Jacobian
// have digits for longer. The headings' variances of a straight chain add up.
TEST_P(MarginalsTest, OfALongStiffChainHaveDigitsOrAreRefused) {
  constexpr int kPoses = 100;
  for (const double strong : {1e4, 1e6, 1e8, 1e10, 1e24}) {
    const Graph graph = stiff_chain(kPoses, strong);
    GraphMarginals marginals(graph, *solver_);
    const bool there = marginals.factorize().ok;
    EXPECT_TRUE(there || strong > (query<JacobianSolver>(*solver_) ? 1e12 : 1e5)) << strong;
    if (there) {
      const double heading = 1.0 + (kPoses - 1) / strong;
      EXPECT_NEAR(marginals.diagonal().back(), heading, 0.01 * heading) << strong;
    } else {
      EXPECT_GE(strong, 1e6);
    }
  }
}

TEST(GraphMarginals, RefuseASolverThatCannot) {
  Registry registry;
  if (!registry.has("linear_solver", "pcg")) GTEST_SKIP();
  const Graph graph = ring_of_poses(5, 0.1);
  const auto pcg = registry.make<LinearSolver>("pcg");
  EXPECT_THROW(GraphMarginals(graph, *pcg), Error);
}

}  // namespace
}  // namespace cairn::test
