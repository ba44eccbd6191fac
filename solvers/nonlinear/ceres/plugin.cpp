// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "ceres_optimizer.hpp"
#include "ceres_options.hpp"
#include "line_search_optimizer.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<Optimizer, CeresOptions>("ceres", [](const CeresOptions& options) {
    return std::make_unique<CeresOptimizer>(ceres_solver_options(options));
  });
  registrar.add<Optimizer, LineSearchOptions>(
      "ceres_line_search", [](const LineSearchOptions& options) {
        return std::make_unique<LineSearchOptimizer>(options);
      });
}
