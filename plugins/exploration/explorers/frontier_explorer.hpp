// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "frontier_goals.hpp"

namespace cairn::exploration {

struct FrontierOptions {
  double length = 0.9, smallest = 0.0, keep = 0.7;
  std::string planner = "grid_dijkstra";

  static auto fields() {
    using O = FrontierOptions;
    return OptionFields<O>()
        .real("length", &O::length, 0.0, 1000.0,
              "frontiers shorter than this count only when there are no longer ones, half as long "
              "at a time [m]")
        .real("smallest", &O::smallest, 0.0, 1000.0,
              "shorter ones are left unexplored [m]; 0: shorter than the robot is wide")
        .real("keep", &O::keep, 0.0, 1.0,
              "the frontier that it was on the way to counts as nearer, by this factor")
        .component<PathPlanner>("planner", &O::planner, "finds the paths");
  }
};

/// Drives to frontiers; which of them, the derived class decides.
class FrontierExplorer : public Explorer {
 public:
  FrontierExplorer(const FrontierOptions& options, Registry& registry);

  void begin(std::uint64_t seed) override;
  Decision decide(const Situation& situation) override;
  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override;

 protected:
  /// Chooses one of the candidates, which are paths to frontiers with the value of their length
  /// (that to the frontier of the last decision times `keep`), and may replace or add some. There
  /// is at least one. `decision.why` begins as empty; then it gets what was chosen.
  virtual void choose(const Situation& situation, Decision& decision) = 0;

  /// Whether `choose` has chosen a frontier.
  virtual bool chose_frontier() const { return true; }

  FrontierGoals& goals() { return goals_; }

 private:
  FrontierOptions options_;
  FrontierGoals goals_;
  std::optional<Eigen::Vector2d> goal_;  ///< of the last decision [m]
};

}  // namespace cairn::exploration
