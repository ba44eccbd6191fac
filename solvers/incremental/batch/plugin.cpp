// SPDX-License-Identifier: BSD-3-Clause
#include "batch_estimator.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

using namespace cairn;

/// The optimizer, with the linear solver put in where it takes one and names none itself.
std::unique_ptr<Optimizer> make_optimizer(const BatchOptions& options, Registry& registry) {
  ComponentSpec spec = parse_component(options.optimizer);
  const OptionSpec* takes = registry.options(Optimizer::kKind, spec.name).find("linear_solver");
  if (takes && takes->type == OptionType::component)
    spec.values.emplace("linear_solver", options.linear_solver);
  return registry.make<Optimizer>(spec);
}

std::unique_ptr<Estimator> make(int every, const BatchOptions& options, Registry& registry) {
  auto tools = std::make_shared<BatchTools>();
  tools->optimizer = make_optimizer(options, registry);
  tools->solver = registry.make<LinearSolver>(options.linear_solver);
  const Stop stop{.max_iterations = options.iterations, .tolerance = options.tolerance};
  return std::make_unique<BatchEstimator>(every, stop, std::move(tools));
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<Estimator, BatchOptions>(
      "batch",
      [](const BatchOptions& options, Registry& registry) { return make(1, options, registry); });
  registrar.add<Estimator, PeriodicBatchOptions>(
      "periodic_batch", [](const PeriodicBatchOptions& options, Registry& registry) {
        return make(options.every, options.batch, registry);
      });
}
