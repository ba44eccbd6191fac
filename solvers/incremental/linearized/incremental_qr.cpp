// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>
#include <utility>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "linearized_estimator.hpp"
#include "square_root_form.hpp"

namespace {

using namespace cairn;

/// Options of the estimator `incremental_qr`.
struct IncrementalQrOptions {
  std::string optimizer = "levenberg_marquardt";
  std::string linear_solver = "block_cholesky";
  int iterations = 100;      ///< of a batch step, at most
  double tolerance = 1e-10;  ///< see `Stop`
  int every = 100;           ///< updates from one batch step to the next

  static auto fields() {
    using O = IncrementalQrOptions;
    return OptionFields<O>()
        .component<Optimizer>(
            "optimizer", &O::optimizer,
            "of batch steps; uses the linear solver below if it has an option of that name")
        .component<LinearSolver>("linear_solver", &O::linear_solver, "of that optimizer")
        .integer("iterations", &O::iterations, 1, 1e9,
                 "maximum number of iterations of a batch step")
        .real("tolerance", &O::tolerance, 0.0, 1.0,
              "a batch step ends when chi2 falls by less than this fraction; 0: exactly that many "
              "iterations")
        .integer("every", &O::every, 1, 1e9,
                 "updates from one batch step, which relinearises and reorders, to the next");
  }
};

std::unique_ptr<Optimizer> make_optimizer(const IncrementalQrOptions& options, Registry& registry) {
  ComponentSpec spec = parse_component(options.optimizer);
  const OptionSpec* takes = registry.options(Optimizer::kKind, spec.name).find("linear_solver");
  if (takes && takes->type == OptionType::component)
    spec.values.emplace("linear_solver", options.linear_solver);
  return registry.make<Optimizer>(spec);
}

}  // namespace

void cairn_register(Registrar& registrar) {
  using namespace cairn::linearized;
  registrar.add<Estimator, IncrementalQrOptions>(
      "incremental_qr", [](const IncrementalQrOptions& options, Registry& registry) {
        BatchSteps batch;
        batch.every = options.every;
        batch.stop = {.max_iterations = options.iterations, .tolerance = options.tolerance};
        batch.optimizer = make_optimizer(options, registry);
        return std::make_unique<LinearizedEstimator>(std::make_unique<SquareRootForm>(),
                                                     std::move(batch));
      });
}
