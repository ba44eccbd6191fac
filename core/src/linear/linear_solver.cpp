// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/linear_solver.hpp"

#include <optional>

#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/seconds.hpp"
#include "cairn/runtime/result_fields.hpp"

namespace cairn {

LinearSolver::~LinearSolver() = default;
LogDeterminant::~LogDeterminant() = default;
ManyRightHandSides::~ManyRightHandSides() = default;
EliminationOrder::~EliminationOrder() = default;
IterativeSolver::~IterativeSolver() = default;

ResultFields<LinearSolverStats> LinearSolverStats::fields() {
  using S = LinearSolverStats;
  const auto if_iterative = [](auto S::*member) {
    return
        [member](const S& s) { return s.iterations > 0 ? std::optional(s.*member) : std::nullopt; };
  };
  return ResultFields<S>()
      .figure("ordering", &S::ordering, "how the variables were ordered")
      .figure("factor_nonzeros", &S::factor_nonzeros,
              "numbers in the factor of H, its diagonal included; 0: not known")
      .figure("factor_flops", &S::factor_flops,
              "multiplications and additions of one factorisation")
      .figure("note", &S::note, "what should be known of the solver")
      .figure("iterations", if_iterative(&S::iterations), "inner iterations of an iterative solver")
      .optional()
      .figure("relative_residual", if_iterative(&S::relative_residual),
              "largest |H x - g| / |g| of an iterative solver")
      .round("{:.1e}")
      .optional()
      .details();
}

ResultFields<Seconds> Seconds::fields() {
  using S = Seconds;
  return ResultFields<S>()
      .figure("total", &S::total, "s", "of the optimisation, without reading and writing")
      .figure("linearize", &S::linearize, "s", "residuals, Jacobians and H")
      .figure("analyze", &S::analyze, "s", "ordering and structure of the factor")
      .figure("factorize", &S::factorize, "s", "factorising H")
      .figure("solve", &S::solve, "s", "substitution")
      .figure("update", &S::update, "s", "steps of the states, and chi2 of trial steps")
      .details();
}

}  // namespace cairn
