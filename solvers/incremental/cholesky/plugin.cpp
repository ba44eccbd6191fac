// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "incremental_cholesky.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<Estimator>(
      "incremental_cholesky",
      OptionTable{}
          .real("accuracy", 5e-3, 0.0, 1.0,
                "relative amount by which chi2 may exceed that of a full batch solution; 0: none")
          .real("significance", 0.25, 0.0, 1e300,
                "a step that lowers chi2 by less than this, and than the accuracy allows, is "
                "deferred")
          .integer("iterations", 10, 1, 1e9, "largest number of linear systems solved per update")
          .integer("recent", 4, 0, 1e9,
                   "variables touched in so many updates, and near them, are ordered last")
          .integer("solve_every", 1, 1, 1e9, "updates that are solved for together")
          .integer("full_every", 0, 0, 1e9,
                   "updates from one full batch step to the next; 0: only on demand")
          .real("budget", 0.0, 0.0, 1e9,
                "seconds that an update may take before relinearisation is deferred; 0: no limit")
          .component("rescuer", Optimizer::kKind.data(), "levenberg_marquardt",
                     "fallback optimizer: runs on the whole graph where a step has raised chi2")
          .choice("kernels", "auto", {"auto", "portable", "avx2", "avx512"},
                  "instruction set, as far as the machine has it"),
      [](const Options& options, Registry& registry) {
        incremental::IncrementalCholesky::Options chosen;
        chosen.settings.accuracy = options.real("accuracy");
        chosen.settings.significance = options.real("significance");
        chosen.settings.iterations = static_cast<int>(options.integer("iterations"));
        chosen.settings.recent = static_cast<int>(options.integer("recent"));
        chosen.settings.kernels = options.text("kernels");
        chosen.solve_every = static_cast<int>(options.integer("solve_every"));
        chosen.full_every = static_cast<int>(options.integer("full_every"));
        chosen.max_seconds = options.real("budget");
        auto rescuer = std::make_shared<incremental::Rescuer>();
        rescuer->optimizer = registry.make<Optimizer>(options.text("rescuer"));
        return std::make_unique<incremental::IncrementalCholesky>(chosen, std::move(rescuer));
      });
}
