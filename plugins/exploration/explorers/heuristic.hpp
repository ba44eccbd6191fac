// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/path_simulation.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "frontier_explorer.hpp"

namespace cairn::exploration {

struct HeuristicOptions {
  FrontierOptions frontier = {};
  PathSimulationOptions simulation = {};
  int frontiers = 2, revisits = 3;
  bool homing = false;

  static auto fields() {
    using O = HeuristicOptions;
    return OptionFields<O>()
        .part(&O::frontier)
        .part(&O::simulation)
        .integer("frontiers", &O::frontiers, 1, 1000, "so many of the nearest are candidates")
        .boolean("homing", &O::homing, "a path back to the first pose is a candidate, too")
        .integer("revisits", &O::revisits, 0, 1000000,
                 "so many drives to known places in a row, without any floor discovered; then "
                 "frontiers alone count; 0: any number, as in the thesis");
  }
};

/// Active Pose SLAM: R. Valencia, J. Valls Miró, G. Dissanayake and J. Andrade-Cetto (IROS 2012).
/// The candidates are paths to the two nearest frontiers, and one to the pose whose loop closure
/// has the most information (thesis, 5.8); each drive is simulated (`PathSimulation`), and that
/// which lowers the sum of both entropies most is carried out.
class Heuristic final : public FrontierExplorer {
 public:
  Heuristic(const HeuristicOptions& options, Registry& registry)
      : FrontierExplorer(options.frontier, registry), options_(options), registry_(registry) {}

  void begin(std::uint64_t seed) override;
  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override;

 private:
  void choose(const Situation& situation, Decision& decision) override;
  bool chose_frontier() const override { return !revisits_now_; }
  std::optional<Candidate> revisit(const Situation& situation);
  std::optional<Candidate> home(const Situation& situation);

  HeuristicOptions options_;
  Registry& registry_;
  bool revisits_now_ = false;  ///< the drive leads to a known place
  int revisits_ = 0;           ///< in a row, since the last discovery
  double coverage_ = 0.0;      ///< at that [m²]
};

}  // namespace cairn::exploration
