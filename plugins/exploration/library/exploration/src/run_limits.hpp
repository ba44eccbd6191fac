// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "cairn/exploration/exploration.hpp"
#include "mapping_robot.hpp"

namespace cairn {

/// Whether a run has come to one of its limits.
class RunLimits {
 public:
  /// `limits` must outlive it.
  explicit RunLimits(const ExplorationLimits& limits) : limits_(limits) {}

  /// Which one it is, a sentence; none: the run goes on.
  std::optional<std::string> reached(MappingRobot& robot, int decisions);

 private:
  std::optional<std::string> knows_enough(MappingRobot& robot);
  std::optional<std::string> finds_little(const MappingRobot& robot);

  const ExplorationLimits& limits_;
  double next_look_ = 0.0;     // at what is known, no earlier [m driven]
  std::size_t rate_from_ = 0;  // the step `kRateDistance` ago
};

}  // namespace cairn
