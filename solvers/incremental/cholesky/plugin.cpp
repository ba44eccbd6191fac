// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "incremental_cholesky.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::incremental;
  registrar.add<Estimator, IncrementalCholeskyOptions>(
      "incremental_cholesky", [](const IncrementalCholeskyOptions& options, Registry& registry) {
        auto rescuer = std::make_shared<Rescuer>();
        rescuer->optimizer = registry.make<Optimizer>(options.rescuer);
        return std::make_unique<IncrementalCholesky>(options, std::move(rescuer));
      });
}
