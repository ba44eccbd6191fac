// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/estimator.hpp"
#include "support/components.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

/// The variable of that index, with the factors of which it is the last.
GraphUpdate arrival(const Graph& graph, int variable) {
  GraphUpdate update;
  update.variables.push_back(graph.variable(variable));
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (std::ranges::max(graph.factor_variables(f)) == variable)
      update.factors.push_back(graph.factor(f));
  }
  return update;
}

void expect_same_estimate(Estimator& a, Estimator& b, double tolerance) {
  for (const Id id : a.variables()) {
    const auto type = a.type(id);
    std::vector<double> apart(static_cast<std::size_t>(type->tangent_size()));
    type->local(1, a.state(id).data(), b.state(id).data(), apart.data());
    for (const double x : apart) EXPECT_NEAR(x, 0.0, tolerance) << id;
  }
}

/// iSAM with R kept by Givens rotations, and with the whole linear system solved each time: the
/// same mathematics, between batch steps and after them.
TEST(IncrementalQr, IsPeriodicBatchWithoutTheSolve) {
  CAIRN_NEEDS("estimator", "incremental_qr");
  CAIRN_NEEDS("estimator", "periodic_batch");
  Registry registry;
  std::vector<Graph> graphs;
  graphs.push_back(ring_of_poses(60, 0.05));
  graphs.push_back(poses_and_points(30, 0.05));
  for (const Graph& graph : graphs) {
    const auto qr = registry.make<Estimator>("incremental_qr:every=17");
    const auto reference = registry.make<Estimator>("periodic_batch:every=17");
    for (int v = 0; v < graph.variable_count(); ++v) {
      const GraphUpdate update = arrival(graph, v);
      EXPECT_TRUE(qr->update(update).ok);
      reference->update(update);
      expect_same_estimate(*qr, *reference, 1e-7);
    }
    EXPECT_NEAR(qr->chi2(), reference->chi2(), 1e-7 * reference->chi2());
  }
}

/// Σ = R⁻¹ R⁻ᵀ is that of H at the same states. The states are compared less closely: chi2 is the
/// same to the last bit within some 1e-8 of its minimum, and which of those states has the lowest
/// is rounding.
TEST(IncrementalQr, GivesTheCovarianceOfBatchAfterABatchStep) {
  CAIRN_NEEDS("estimator", "incremental_qr");
  CAIRN_NEEDS("estimator", "batch");
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  Registry registry;
  const Graph graph = poses_and_points(30, 0.05);
  const auto qr = registry.make<Estimator>("incremental_qr:tolerance=1e-16");
  const auto batch = registry.make<Estimator>("batch:tolerance=1e-16");
  for (int v = 0; v < graph.variable_count(); ++v) {
    qr->update(arrival(graph, v));
    batch->update(arrival(graph, v), {.defer = true});
  }
  EXPECT_TRUE(qr->update({}, {.full = true}).converged);
  batch->update({}, {.full = true});
  expect_same_estimate(*qr, *batch, 1e-7);
  EXPECT_NEAR(qr->chi2(), batch->chi2(), 1e-13 * batch->chi2());
  Graph there = graph.clone();
  for (int v = 0; v < there.variable_count(); ++v) there.set_state(v, qr->state(there.id(v)));
  const auto solver = registry.make<LinearSolver>("block_cholesky");
  GraphMarginals marginals(there, *solver);
  ASSERT_TRUE(marginals.factorize().ok);
  const std::vector<Id> all = qr->variables();
  for (const Id id : all) {
    const int v = *there.find(id);
    std::vector<std::pair<int, int>> pairs;
    for (const Id row : all) pairs.emplace_back(*there.find(row), v);
    std::vector<double> wanted = marginals.blocks(pairs);
    std::size_t rows = 0;
    for (const Id row : all) rows += static_cast<std::size_t>(qr->type(row)->tangent_size());
    const auto columns = static_cast<std::size_t>(qr->type(id)->tangent_size());
    std::vector<double> found(rows * columns);
    ASSERT_TRUE(qr->covariance_column(id, all, found));
    // One block after the other there, one column after the other here.
    std::size_t first = 0, block = 0;
    for (const Id row : all) {
      const auto height = static_cast<std::size_t>(qr->type(row)->tangent_size());
      for (std::size_t c = 0; c < columns; ++c) {
        for (std::size_t r = 0; r < height; ++r)
          EXPECT_NEAR(found[c * rows + first + r], wanted[block + c * height + r], 1e-9) << id;
      }
      first += height;
      block += height * columns;
    }
  }
}

}  // namespace
}  // namespace cairn::test
