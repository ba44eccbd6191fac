// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "ede_gradient.hpp"
#include "ede_rrt_star.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Explorer, EdeRrtStarOptions>(
      "ede_rrt_star", [](const EdeRrtStarOptions& options, Registry& registry) {
        return std::make_unique<EdeRrtStar>(options, registry);
      });
  registrar.add<Explorer, EdeGradientOptions>(
      "ede_gradient", [](const EdeGradientOptions& options, Registry& registry) {
        return std::make_unique<EdeGradient>(options, registry);
      });
}
