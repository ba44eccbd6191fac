// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/arrival_order.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "problem_setup.hpp"

namespace cairn::app {

/// An estimator beside a batch optimisation of the same measurements.
struct BatchCheck {
  int step = 0;           ///< from 1
  double chi2 = 0.0;      ///< of the estimator
  double batch = 0.0;     ///< of an optimisation of everything so far from the initial estimate
  double polished = 0.0;  ///< of an optimisation from the estimator's estimate
  /// Largest ‖Σ_ii − Σ'_ii‖ / ‖Σ'_ii‖ of the covariances kept, Σ' being the selected inverse of the
  /// same graph at the same estimate; none if that was not asked for.
  std::optional<double> covariance_difference = std::nullopt;

  /// By which part the estimator is above the lower of the two optimisations; 0 where they are 0.
  double excess() const;
};

/// Compares an estimator with batch optimisation along a replay.
class BatchChecker {
 public:
  /// Both outlive this object. `covariances`: compare the kept block diagonal too.
  BatchChecker(const Graph& whole, const ProblemSetup& setup, Registry& registry, bool covariances);

  /// These elements are part of the checks from now on.
  void add(const Arrival& arrival);
  BatchCheck check(int step, Estimator& estimator);

 private:
  double optimized_chi2(Graph graph) const;
  double covariance_difference(Estimator& estimator, const Graph& graph) const;

  const Graph& whole_;
  const ProblemSetup& setup_;
  bool covariances_;
  std::unique_ptr<Optimizer> optimizer_;
  std::unique_ptr<LinearSolver> solver_;
  Graph so_far_;
  std::vector<int> index_;  ///< in so_far_, by index in the whole graph
};

}  // namespace cairn::app
