// SPDX-License-Identifier: BSD-3-Clause
#include "batch_estimator.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

using namespace cairn;

OptionTable batch_options() {
  OptionTable table;
  table
      .component("optimizer", Optimizer::kKind.data(), "levenberg_marquardt",
                 "the optimizer; uses the linear solver below if it has an option of that name")
      .component("linear_solver", LinearSolver::kKind.data(), "block_cholesky",
                 "solves the normal equations, and for covariances")
      .integer("iterations", 100, 1, 1e9, "largest number of iterations of a batch step")
      .real("tolerance", 1e-10, 0.0, 1.0,
            "a batch step ends when chi2 falls by less than this fraction; 0: exactly that many "
            "iterations");
  return table;
}

/// The optimizer, with the linear solver put in where it takes one and names none itself.
std::unique_ptr<Optimizer> make_optimizer(const Options& options, Registry& registry) {
  ComponentSpec spec = parse_component(options.text("optimizer"));
  const OptionSpec* takes = registry.options(Optimizer::kKind, spec.name).find("linear_solver");
  if (takes && takes->type == OptionType::component)
    spec.values.emplace("linear_solver", options.text("linear_solver"));
  return registry.make<Optimizer>(spec);
}

std::unique_ptr<Estimator> make(int every, const Options& options, Registry& registry) {
  auto tools = std::make_shared<BatchTools>();
  tools->optimizer = make_optimizer(options, registry);
  tools->solver = registry.make<LinearSolver>(options.text("linear_solver"));
  const Stop stop{.max_iterations = static_cast<int>(options.integer("iterations")),
                  .tolerance = options.real("tolerance")};
  return std::make_unique<BatchEstimator>(BatchEstimatorOptions{every, stop}, std::move(tools));
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<Estimator>(
      "batch", batch_options(),
      [](const Options& options, Registry& registry) { return make(1, options, registry); });
  registrar.add<Estimator>(
      "periodic_batch",
      batch_options().integer("every", 100, 1, 1e9, "updates from one batch step to the next"),
      [](const Options& options, Registry& registry) {
        return make(static_cast<int>(options.integer("every")), options, registry);
      });
}
