// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

struct DoglegOptions {
  std::string linear_solver = "block_cholesky";  ///< of the normal equations
  double initial_radius = 1e4;  ///< of the trust region, in the norm of diag(H); at least √chi2

  static auto fields() {
    using O = DoglegOptions;
    return OptionFields<O>()
        .component<LinearSolver>("linear_solver", &O::linear_solver, "solves the normal equations")
        .real("initial_radius", &O::initial_radius, 1e-12, 1e30,
              "of the trust region, in the norm of diag(H); √chi2 if that is more");
  }
};

/// Powell's dogleg (Powell 1970; Nocedal and Wright 2006, ch. 4): the step is the point of the
/// dogleg path
/// (`DoglegPath`) within a trust region, whose radius follows how well the model foretold chi2. A
/// step is taken only if it lowers chi2; one that is not costs neither a linearisation nor a
/// factorisation. With Stop.tolerance = 0 it makes exactly the number of trial steps asked for.
class Dogleg final : public Optimizer {
 public:
  Dogleg(std::unique_ptr<LinearSolver> solver, DoglegOptions options);
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override;

 private:
  std::unique_ptr<LinearSolver> solver_;
  DoglegOptions options_;
};

}  // namespace cairn
