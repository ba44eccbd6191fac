// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "ceres_optimizer.hpp"
#include "ceres_options.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Optimizer>(
      "ceres", cairn::ceres_option_table(), [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<cairn::CeresOptimizer>(
            cairn::ceres_solver_options(options),
            cairn::CeresLoss{options.text("loss"), options.real("loss_scale")});
      });
}
