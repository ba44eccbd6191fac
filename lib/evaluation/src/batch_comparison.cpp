// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/batch_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"

namespace cairn {
namespace {

constexpr const char* kOptimizer = "levenberg_marquardt";
constexpr const char* kLinearSolver = "block_cholesky";

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
  constexpr double kRounding = 1e-9;
  const double best = std::min(batch, polished);
  return (chi2 - best) / std::max(best, kRounding);
}

BatchChecker::BatchChecker(const Graph& recording, BatchProblem problem, Registry& registry)
    : recording_(recording),
      problem_(std::move(problem)),
      optimizer_(registry.make<Optimizer>(kOptimizer)),
      solver_(registry.make<LinearSolver>(kLinearSolver)) {
  if (problem_.covariances && !query<Marginals>(*solver_)) {
    throw Error(ErrorCode::usage,
                fmt::format("covariances cannot be compared: linear solver {} has no marginals",
                            kLinearSolver));
  }
}

void BatchChecker::add(const Arrival& arrival) {
  apply_update(arrival_update(recording_, arrival), so_far_, ids_);
}

BatchCheck BatchChecker::check(int step, Estimator& estimator) {
  BatchCheck result{.step = step, .chi2 = estimator.chi2()};
  Graph polished = estimator.graph();
  polished.set_loss(problem_.loss, problem_.loss_on);
  if (problem_.covariances)
    result.covariance_difference = covariance_difference(estimator, polished);
  Graph batch = so_far_.clone();
  batch.set_loss(problem_.loss, problem_.loss_on);
  if (problem_.initialise) problem_.initialise(batch);
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

ResultFields<BatchCheck> BatchCheck::fields() {
  using C = BatchCheck;
  return ResultFields<C>()
      .figure("step", &C::step, "from 1")
      .figure("chi2", &C::chi2, "of the estimator")
      .round("{:.8g}")
      .figure("batch", &C::batch, "of an optimisation from the initial estimate")
      .round("{:.8g}")
      .figure("polished", &C::polished, "of an optimisation from the estimator's estimate")
      .round("{:.8g}")
      .figure("excess", &C::excess, "how far chi2 is above the lower of these, relative to it")
      .round("{:.3g}")
      .figure("covariance_difference", &C::covariance_difference,
              "largest relative difference of a covariance from the exact one")
      .round("{:.2g}")
      .optional();
}

}  // namespace cairn
