// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/known_surroundings.hpp"
#include "cairn/planning/frontier_view.hpp"

namespace cairn::exploration {

/// Frontier cells at which the robot has looked in vain: they do not attract it until more of the
/// map around them is known.
class GivenUpFrontiers {
 public:
  void begin() { cells_.clear(); }
  void add(const FloorMap& map, std::span<const SeenFrontier> seen);
  /// Marks them as opaque, and those of frontiers shorter than `least` [m]. Cells around which more
  /// is known by now are forgotten.
  void remove_from(std::vector<BeamCell>& cells, const FloorMap& map, double least);

 private:
  std::vector<KnownSurroundings> cells_;
};

}  // namespace cairn::exploration
