// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "levenberg_marquardt.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<Optimizer, LevenbergMarquardtOptions>(
      "levenberg_marquardt", [](const LevenbergMarquardtOptions& options, Registry& registry) {
        return std::make_unique<LevenbergMarquardt>(
            registry.make<LinearSolver>(options.linear_solver), options);
      });
}
