// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/potential_field.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "decision_time.hpp"
#include "ede_goals.hpp"

namespace cairn::exploration {

struct EdeGradientOptions {
  EdeGoalsOptions goals = {};
  PotentialFieldOptions potential = {};
  double weight = 1.1;
  std::string fallback = "ede_rrt_star";

  static auto fields() {
    using O = EdeGradientOptions;
    return OptionFields<O>()
        .part(&O::goals)
        .part(&O::potential)
        .real("weight", &O::weight, 1.0, 3.0,
              "of obstacles, the first that is tried of 1, 1.1, 1.25, 1.5, 2 and 3; with 1 they do "
              "not repel, and the potential is nearly constant far from attractors")
        .text("fallback", &O::fallback,
              "the explorer that decides where the gradient leads nowhere; none: the run ends as "
              "stuck");
  }
};

/// Drives down the gradient of the potential information field (thesis, 5.3.2).
class EdeGradient final : public Explorer {
 public:
  /// Throws `Error` (usage) for an option's name that is not offered.
  EdeGradient(const EdeGradientOptions& options, Registry& registry);

  void begin(std::uint64_t seed) override;
  Decision decide(const Situation& situation) override;
  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override;

 private:
  std::optional<Decision> descend(const Situation& situation, const ReachableField& at,
                                  const DecisionTime& time);
  Decision stuck(const Situation& situation, const DecisionTime& time);

  EdeGradientOptions options_;
  EdeGoals goals_;
  std::unique_ptr<Explorer> fallback_;
  bool falls_back_ = false;
  bool is_cut_ = false;  ///< the last descent: by the time budget
  int decisions_ = 0, stuck_ = 0;
  std::size_t too_many_ = 0;  ///< configurations: a potential of as many was cut too short
};

}  // namespace cairn::exploration
