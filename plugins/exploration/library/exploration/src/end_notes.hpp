// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/exploration/exploration.hpp"

namespace cairn {

/// What a result does not say about its run.
struct RunFacts {
  int not_driven = 0;              ///< paths that no curve of the robot's follows
  double turning_radius = 0.0;     ///< [m]
  double longest_unmatched = 0.0;  ///< driven between two scans that were matched [m]
  bool match_consecutive = true, recorded = false;
};

/// What a user should know before trusting the map of a run that has ended: sentences.
std::vector<std::string> notes_of_end(const ExplorationResult& result, const RunFacts& facts);

}  // namespace cairn
