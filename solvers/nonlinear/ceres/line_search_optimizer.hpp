// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/solver.h>

#include "cairn/solve/optimizer.hpp"
#include "line_search_options.hpp"

namespace cairn {

/// Ceres' line search methods: each iteration chooses a direction from gradients alone (L-BFGS:
/// Nocedal 1980; BFGS; nonlinear conjugate gradients; steepest descent) and searches along it for a
/// step that fulfils the strong Wolfe or the Armijo condition (Nocedal, Wright 2006, sections 3.1,
/// 3.5, 5.2, 7.2). No linear system is solved, so an iteration is cheap, and many are needed: about
/// as many as a preconditioned conjugate gradient method takes for all linear systems together.
///
/// Residuals, Jacobians, retractions and losses are those of the graph (`CeresProblem`), in
/// coordinates in which the diagonal blocks of H are unit matrices at the start: else metres and
/// radians would decide the direction. Converged means what it means for all optimizers: the step
/// H⁻¹g predicts a decrease below the tolerance (`NewtonDecrement`), which is evaluated where
/// iterations lower chi2 by less than that. A run that finds no further step, and is not there, is
/// `diverged`.
class LineSearchOptimizer final : public Optimizer {
 public:
  /// Throws `Error` (usage) for a combination that Ceres does not accept.
  explicit LineSearchOptimizer(const LineSearchOptions& options);
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override;

 private:
  Summary run(Graph& graph, const Stop& stop, Observer& observer) const;

  LineSearchOptions options_;
  ceres::Solver::Options ceres_;
};

}  // namespace cairn
