// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/exploration/explorer.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/planning/path_optimality.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "frontier_explorer.hpp"

namespace cairn::exploration {

struct DoptOptions {
  FrontierOptions frontier = {};
  PathOptimalityOptions optimality = {};
  double margin = 0.0;
  std::string solver = "block_cholesky";

  static auto fields() {
    using O = DoptOptions;
    return OptionFields<O>()
        .part(&O::frontier)
        .part(&O::optimality)
        .real("margin", &O::margin, 0.0, 1000.0,
              "of the frontiers whose D-optimality is so near to the largest the nearest is chosen "
              "[ln]")
        .component<LinearSolver>("solver", &O::solver, "factorises the graph's matrix");
  }
};

/// Drives to the frontier with whose path the graph has the largest D-optimality (Placed and
/// Castellanos 2021): `PathOptimalities`.
class Dopt final : public FrontierExplorer {
 public:
  Dopt(const DoptOptions& options, Registry& registry);

 private:
  void choose(const Situation& situation, Decision& decision) override;

  DoptOptions options_;
  std::unique_ptr<LinearSolver> solver_;
};

}  // namespace cairn::exploration
