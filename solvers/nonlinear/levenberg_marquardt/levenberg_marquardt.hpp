// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

struct LevenbergMarquardtOptions {
  std::string linear_solver = "block_cholesky";  ///< of the normal equations
  /// Damping of the first step, relative to the diagonal of H. 0: 1e-10, and at least 1e-6 after
  /// the first step that is not taken; 1e-6 with robust losses; or 1e-4 where the gauge is left
  /// free: there damping alone makes H regular, and such problems (cameras and points) are so far
  /// from linear that a first step with less may throw points behind their cameras, into another
  /// minimum.
  double initial_lambda = 0.0;

  static auto fields() {
    using O = LevenbergMarquardtOptions;
    return OptionFields<O>()
        .component<LinearSolver>("linear_solver", &O::linear_solver, "solves the normal equations")
        .real(
            "initial_lambda", &O::initial_lambda, 0.0, 1e16,
            "damping of the first step, as a fraction of the diagonal of H; 0: 1e-10, with robust "
            "losses 1e-6, where the gauge is left free 1e-4");
  }
};

/// Levenberg-Marquardt: (H + λ D) δ = g with D = diag(H) (Marquardt's scaling, which makes λ a pure
/// number whatever the units) and Nielsen's rule for λ, with two additions (`Damping`). A step is
/// taken only if it lowers chi2; one that is not costs a factorisation but no linearisation.
/// Convergence is judged on undamped steps (`Endgame`), so that heavy damping is not mistaken for
/// convergence. With Stop.tolerance = 0 it makes exactly the number of trial steps asked for, all
/// of them damped.
class LevenbergMarquardt final : public Optimizer {
 public:
  LevenbergMarquardt(std::unique_ptr<LinearSolver> solver, LevenbergMarquardtOptions options);
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override;

 private:
  std::unique_ptr<LinearSolver> solver_;
  LevenbergMarquardtOptions options_;
};

}  // namespace cairn
