// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/path_planner.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "decision_time.hpp"
#include "ede_goals.hpp"

namespace cairn::exploration {

struct EdeRrtStarOptions {
  EdeGoalsOptions goals = {};
  bool per_metre = false;
  int candidates = 8;
  std::string planner = "rrt_star", fallback = "none";

  static auto fields() {
    using O = EdeRrtStarOptions;
    return OptionFields<O>()
        .part(&O::goals)
        .boolean("per_metre", &O::per_metre, "compares E by the length of the path")
        .integer("candidates", &O::candidates, 1, 1000,
                 "configurations that are tried in their order until there is a path to one")
        .component<PathPlanner>("planner", &O::planner, "finds the paths")
        .text("fallback", &O::fallback,
              "the explorer that goes on where no configuration is worth driving to, such as "
              "frontier; none: the run ends");
  }
};

/// Drives to the configuration with the least E by a short path (thesis, 5.3.2).
class EdeRrtStar final : public Explorer {
 public:
  /// Throws `Error` (usage) for an option's name that is not offered.
  EdeRrtStar(const EdeRrtStarOptions& options, Registry& registry);

  void begin(std::uint64_t seed) override;
  Decision decide(const Situation& situation) override;
  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override;

 private:
  /// A configuration that is worth driving to.
  struct Goal {
    std::size_t configuration = 0;
    double value = 0.0;  ///< E, or E per metre
  };

  std::vector<Goal> best_goals(const Situation& situation, const ReachableField& at) const;
  std::optional<PlannedPath> path_to(const ReachableField& at, std::size_t configuration);
  bool drive(const Situation& situation, bool tight, const DecisionTime& time, Decision& decision);

  EdeRrtStarOptions options_;
  EdeGoals goals_;
  std::unique_ptr<PathPlanner> planner_;
  std::unique_ptr<Explorer> fallback_;
  bool falls_back_ = false;
};

}  // namespace cairn::exploration
