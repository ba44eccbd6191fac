// SPDX-License-Identifier: BSD-3-Clause
#include "replay_checks.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::app {
namespace {

/// ‖a − b‖ / ‖b‖ of two blocks.
double relative_difference(std::span<const double> a, std::span<const double> b) {
  double apart = 0.0, size = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    apart += (a[k] - b[k]) * (a[k] - b[k]);
    size += b[k] * b[k];
  }
  return size > 0.0 ? std::sqrt(apart / size) : std::sqrt(apart);
}

}  // namespace

double BatchCheck::excess() const {
  const double best = std::min(batch, polished);
  return best > 0.0 ? chi2 / best - 1.0 : 0.0;
}

BatchChecker::BatchChecker(const Graph& whole, const ProblemSetup& setup, Registry& registry,
                           bool covariances)
    : whole_(whole),
      setup_(setup),
      covariances_(covariances),
      optimizer_(registry.make<Optimizer>(kDefaultOptimizer)),
      solver_(registry.make<LinearSolver>(kDefaultLinearSolver)),
      index_(static_cast<std::size_t>(whole.variable_count()), -1) {
  if (covariances && !query<Marginals>(*solver_)) {
    throw Error(
        ErrorCode::usage,
        fmt::format("--covariance-check: linear solver {} has no marginals", kDefaultLinearSolver));
  }
}

void BatchChecker::add(const Arrival& arrival) {
  for (const int v : arrival.variables) {
    index_[v] = so_far_.add_variable(whole_.type_of(v), whole_.id(v), whole_.state(v));
    if (whole_.fixed(v)) so_far_.set_fixed(index_[v]);
  }
  std::vector<int> variables;
  for (const int f : arrival.factors) {
    variables.clear();
    for (const std::int32_t v : whole_.factor_variables(f)) variables.push_back(index_[v]);
    so_far_.add_factor(whole_.type_of_factor(f), variables, whole_.measurement(f),
                       whole_.information(f));
  }
}

BatchCheck BatchChecker::check(int step, Estimator& estimator) {
  BatchCheck result{.step = step, .chi2 = estimator.chi2()};
  Graph polished = estimator.graph();
  polished.set_loss(setup_.loss(), setup_.loss_selector());
  if (covariances_) result.covariance_difference = covariance_difference(estimator, polished);
  Graph batch = so_far_.clone();
  setup_.apply(batch);
  result.batch = optimized_chi2(std::move(batch));
  result.polished = optimized_chi2(std::move(polished));
  return result;
}

double BatchChecker::optimized_chi2(Graph graph) const {
  if (graph.factor_count() == 0) return 0.0;
  return optimizer_->optimize(graph).final_chi2;
}

double BatchChecker::covariance_difference(Estimator& estimator, const Graph& graph) const {
  GraphMarginals batch(graph, *solver_);
  if (!batch.factorize().ok) return std::nan("");
  const std::vector<double> diagonal = batch.diagonal();
  std::vector<double> block;
  double largest = 0.0;
  std::size_t next = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const auto n = static_cast<std::size_t>(graph.type(v).tangent_size());
    block.resize(n * n);
    if (!estimator.covariance(graph.id(v), graph.id(v), block)) return std::nan("");
    largest =
        std::max(largest, relative_difference(block, std::span(diagonal).subspan(next, n * n)));
    next += n * n;
  }
  return largest;
}

}  // namespace cairn::app
