// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/solver.h>

#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// Ceres Solver as a baseline: the graph becomes a ceres::Problem (`CeresProblem`) with the same
/// residuals, Jacobians, retractions and loss, so that chi2 can be compared to the last digits.
/// Iterations are Ceres' trial steps. With Stop.tolerance = 0 Ceres gets no reason of ours to stop
/// early.
class CeresOptimizer final : public Optimizer {
 public:
  explicit CeresOptimizer(ceres::Solver::Options options);
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override;

 private:
  Summary run(Graph& graph, const Stop& stop, Observer& observer) const;

  ceres::Solver::Options options_;
};

}  // namespace cairn
