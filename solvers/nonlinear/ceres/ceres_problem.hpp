// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"

namespace cairn {

/// A graph as a ceres::Problem with cairn's residuals, Jacobians, retractions and loss.
///
/// Ceres wants Jacobians with respect to the ambient state and multiplies them by the Jacobian of
/// its Plus. Ours are with respect to the tangent space at once: so Plus is said to have the
/// Jacobian [I; 0], and our columns stand first among the ambient ones, followed by zeros. The
/// product is ours, exactly.
///
/// Ceres minimises ½ Σ ρ(‖r‖²), cairn states twice that.
class CeresProblem {
 public:
  /// `values`, which Ceres moves, must outlive this object. `loss`: a loss of Ceres' own for all
  /// factors that take one, or null for each factor's own.
  CeresProblem(const Graph& graph, const Gauge& gauge, Values& values,
               std::unique_ptr<ceres::LossFunction> loss);

  ceres::Problem& problem() { return problem_; }

 private:
  void add_variables(const Graph& graph, const Gauge& gauge, Values& values);
  void add_factors(const Graph& graph, Values& values);

  // Owned here and only lent to the problem, which therefore is the last to come and the first to
  // go.
  std::vector<std::unique_ptr<ceres::LossFunction>> losses_;  // as Graph::losses(), or Ceres' own
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds_;   // by variable pool
  std::vector<std::unique_ptr<ceres::CostFunction>> costs_;
  ceres::Problem problem_;
};

/// The graph's loss in Ceres' terms.
std::unique_ptr<ceres::LossFunction> wrap_loss(const Loss& loss);

}  // namespace cairn
