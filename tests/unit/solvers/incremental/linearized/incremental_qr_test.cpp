// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

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

/// With linearisation points that stay, the estimate is R⁻¹b: that of one batch linear solve.
TEST(IncrementalQr, GivesTheCovarianceOfBatchAfterABatchStep) {
  CAIRN_NEEDS("estimator", "incremental_qr");
  CAIRN_NEEDS("estimator", "batch");
  Registry registry;
  const Graph graph = poses_and_points(30, 0.05);
  // Gauss-Newton takes steps that change chi2 by less than its rounding; what compares chi2 would
  // end some 1e-8 from the minimum.
  CAIRN_NEEDS("optimizer", "gauss_newton");
  const auto qr = registry.make<Estimator>("incremental_qr:optimizer=gauss_newton,tolerance=1e-22");
  const auto batch = registry.make<Estimator>("batch:optimizer=gauss_newton,tolerance=1e-22");
  for (int v = 0; v < graph.variable_count(); ++v) {
    qr->update(arrival(graph, v));
    batch->update(arrival(graph, v), {.defer = true});
  }
  EXPECT_TRUE(qr->update({}, {.full = true}).converged);
  batch->update({}, {.full = true});
  expect_same_estimate(*qr, *batch, 1e-9);
  const std::vector<Id> all = qr->variables();
  const auto rows = static_cast<std::size_t>(graph.tangent_size());
  for (const Id id : all) {
    const auto columns = static_cast<std::size_t>(qr->type(id)->tangent_size());
    std::vector<double> found(rows * columns), wanted(rows * columns);
    ASSERT_TRUE(qr->covariance_column(id, all, found));
    ASSERT_TRUE(batch->covariance_column(id, all, wanted));
    for (std::size_t k = 0; k < wanted.size(); ++k) EXPECT_NEAR(found[k], wanted[k], 1e-9) << id;
  }
}

}  // namespace
}  // namespace cairn::test
