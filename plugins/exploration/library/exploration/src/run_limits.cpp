// SPDX-License-Identifier: BSD-3-Clause
#include "run_limits.hpp"

#include <cmath>
#include <vector>

#include <fmt/core.h>

namespace cairn {

std::optional<std::string> RunLimits::reached(MappingRobot& robot, int decisions) {
  const ExplorationStep& last = robot.steps().back();
  if (last.distance >= limits_.distance) return fmt::format("{:g} m are driven", limits_.distance);
  if (last.step >= limits_.steps) return fmt::format("{} motions are made", limits_.steps);
  if (decisions >= limits_.decisions)
    return fmt::format("{} decisions are made", limits_.decisions);
  if (auto why = knows_enough(robot)) return why;
  return finds_little(robot);
}

std::optional<std::string> RunLimits::knows_enough(MappingRobot& robot) {
  constexpr double kBetweenLooks = 0.5;  // [m]
  if (!std::isfinite(limits_.known) || robot.driven() < next_look_) return std::nullopt;
  next_look_ = robot.driven() + kBetweenLooks;
  const double seen = robot.reachable_seen();
  if (seen < limits_.known) return std::nullopt;
  return fmt::format("{:.1f} % of what the body can cover is seen", 100.0 * seen);
}

std::optional<std::string> RunLimits::finds_little(const MappingRobot& robot) {
  const std::vector<ExplorationStep>& steps = robot.steps();
  const ExplorationStep& last = steps.back();
  const double from = last.distance - ExplorationLimits::kRateDistance;
  if (!(limits_.rate > 0.0) || from < 0.0) return std::nullopt;
  while (steps[rate_from_ + 1].distance <= from) ++rate_from_;
  const ExplorationStep& before = steps[rate_from_];
  const double rate = (last.coverage - before.coverage) / (last.distance - before.distance);
  if (!(rate < limits_.rate)) return std::nullopt;
  return fmt::format("the last {:.0f} m brought {:.2f} m² of floor a metre",
                     ExplorationLimits::kRateDistance, rate);
}

}  // namespace cairn
