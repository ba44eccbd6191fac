// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/update/graph_update.hpp"
#include "cairn/update/recorded_graph.hpp"

namespace cairn {

/// An estimator beside a batch optimisation of the same measurements.
struct CAIRN_API BatchCheck {
  int step = 0;           ///< from 1
  double chi2 = 0.0;      ///< of the estimator
  double batch = 0.0;     ///< of an optimisation from the initial estimate of everything so far
  double polished = 0.0;  ///< of an optimisation from the estimator's estimate
  /// Largest ‖Σ_ii − Σ'_ii‖ / ‖Σ'_ii‖ of the covariances kept, Σ' being the selected inverse of the
  /// same graph at the same estimate; none if that was not asked for.
  std::optional<double> covariance_difference = std::nullopt;

  /// (χ² − χ²_best) / χ²_best with the lower of the two optimisations; where that is below 10⁻⁹,
  /// which is rounding, relative to 10⁻⁹.
  double excess() const;

  static ResultFields<BatchCheck> fields();
};

/// How the batch optimisations are set up.
struct BatchProblem {
  std::shared_ptr<const Loss> loss = nullptr;  ///< shared: graphs and their clones use one loss
  FactorSelector loss_on = {};
  /// Computes the initial estimate of everything so far; empty: the recorded states.
  std::function<void(Graph&)> initialise = {};
  bool covariances = false;  ///< compare the kept block diagonal too
};

/// Compares an estimator with batch optimisation (Levenberg-Marquardt) along a replay.
class CAIRN_API BatchChecker {
 public:
  /// `recording` must outlive this object. Throws `Error` (usage) if covariances are to be compared
  /// and the linear solver has none.
  BatchChecker(const Graph& recording, BatchProblem problem, Registry& registry);

  /// Adds a step of the recording to the graph that is compared.
  void add(const Arrival& arrival);
  BatchCheck check(int step, Estimator& estimator);

 private:
  double optimized_chi2(Graph graph) const;
  double covariance_difference(Estimator& estimator, const Graph& graph) const;

  const Graph& recording_;
  BatchProblem problem_;
  std::unique_ptr<Optimizer> optimizer_;
  std::unique_ptr<LinearSolver> solver_;
  Graph so_far_;
  FactorIds ids_;
};

}  // namespace cairn
