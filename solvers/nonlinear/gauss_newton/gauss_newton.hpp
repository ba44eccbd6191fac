// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

struct GaussNewtonOptions {
  std::string linear_solver = "block_cholesky";  ///< of the normal equations
  int rises = 8;  ///< iterations in a row in which chi2 may rise before the run counts as diverging

  static auto fields() {
    using O = GaussNewtonOptions;
    return OptionFields<O>()
        .component<LinearSolver>("linear_solver", &O::linear_solver, "solves the normal equations")
        .integer("rises", &O::rises, 1, 1e6,
                 "iterations in a row in which chi2 may rise before the run counts as diverging");
  }
};

/// Gauss-Newton (Ila et al. 2017, eq. 3-4): H δ = g, x ← retract(x, δ), every step taken whole. Far
/// from the minimum chi2 may rise; the best estimate found is kept all the same. With
/// Stop.tolerance = 0 it does exactly the iterations asked for, stopping earlier only for numbers
/// that are not finite or a factorisation that fails.
class GaussNewton final : public Optimizer {
 public:
  GaussNewton(std::unique_ptr<LinearSolver> solver, GaussNewtonOptions options);
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override;

 private:
  std::unique_ptr<LinearSolver> solver_;
  GaussNewtonOptions options_;
};

}  // namespace cairn
