// SPDX-License-Identifier: BSD-3-Clause
#include "determinant_gain.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/runtime/error.hpp"
#include "sparsify/edge_selection/loop_graphs.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::edges {
namespace {

/// Adds candidates in some order, many more than fit between two factorisations, and compares each
/// gain on the way with a difference of dense determinants.
void compare_with_dense(const Graph& graph, DeterminantGain& gain,
                        const std::function<double(const std::vector<int>& stay)>& dense) {
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  test::Draw draw(3);
  std::vector<int> stay;
  for (int k = 0; k < static_cast<int>(std::ssize(candidates)); k += 2) {
    const double before = dense(stay);
    for (int j = k + 1; j < static_cast<int>(std::ssize(candidates)); j += 9) {
      std::vector<int> with = stay;
      with.insert(std::ranges::lower_bound(with, candidates[static_cast<std::size_t>(j)]),
                  candidates[static_cast<std::size_t>(j)]);
      const double expected = dense(with) - before;
      ASSERT_NEAR(gain.gain(j), expected, 1e-7 * std::max(1.0, expected))
          << k << " added, of " << j;
    }
    gain.add(k);
    stay.push_back(candidates[static_cast<std::size_t>(k)]);
  }
}

TEST(DeterminantGain, OfFactorsIsThatOfDenseInformation) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  for (const int dimension : {2, 3}) {
    Registry registry;
    const Graph graph = random_loops(registry, dimension, 12, 90, 5);
    const std::vector<int> candidates = find_loop_closures(graph).candidates;
    ASSERT_EQ(candidates.size(), 90U);
    const auto solver = registry.make<LinearSolver>("block_cholesky");
    DeterminantGain gain(linear_model(graph, candidates), *solver);
    compare_with_dense(graph, gain, [&](const std::vector<int>& stay) {
      return test::log_determinant_of(
          test::dense_system(with_candidates(graph, candidates, stay)).H);
    });
  }
}

/// One of a component is grounded, and any would do: ln |L| is that of the number of spanning
/// trees.
TEST(DeterminantGain, OfALaplacianIsThatOfTheDenseOne) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  Registry registry;
  Graph graph = random_loops(registry, 2, 15, 220, 6);
  graph.set_fixed(0, false);
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  for (const EdgeWeight weight : {EdgeWeight::rotation, EdgeWeight::translation}) {
    const auto solver = registry.make<LinearSolver>("block_cholesky");
    DeterminantGain gain(laplacian_model(graph, candidates, weight), *solver);
    compare_with_dense(graph, gain, [&](const std::vector<int>& stay) {
      const Graph left = with_candidates(graph, candidates, stay);
      const std::vector<RelativeEdge> edges = relative_edges(left, all_factors(left));
      return test::log_determinant_of(
          dense_laplacian(left, edges, weight).bottomRightCorner(14, 14));
    });
  }
}

TEST(DeterminantGain, AnySolverWithTheAbilitiesDoes) {
  Registry registry;
  const Graph graph = random_loops(registry, 2, 10, 12, 7);
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  const auto reference = registry.make<LinearSolver>("block_cholesky");
  DeterminantGain expected(linear_model(graph, candidates), *reference);
  int able = 0;
  for (const std::string& name : registry.names(LinearSolver::kKind)) {
    const auto solver = registry.make<LinearSolver>(name);
    if (query<JacobianSolver>(*solver)) continue;  // takes no information matrix
    if (!query<Marginals>(*solver) || !query<LogDeterminant>(*solver)) {
      EXPECT_THROW(DeterminantGain(linear_model(graph, candidates), *solver), Error) << name;
      continue;
    }
    ++able;
    DeterminantGain gain(linear_model(graph, candidates), *solver);
    gain.add(3);
    if (able == 1) expected.add(3);
    for (const int k : {0, 5, 11}) EXPECT_NEAR(gain.gain(k), expected.gain(k), 1e-7) << name;
  }
  EXPECT_GE(able, 1);
}

}  // namespace
}  // namespace cairn::edges
