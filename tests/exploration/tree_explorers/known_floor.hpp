// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/grid/floor_survey.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::test {

/// By cell the distance [m] to the nearest one that is not free, or outside, up to `most` [m].
inline std::vector<float> capped_clearance(const GridFrame& frame,
                                           const std::vector<CellState>& cells, double most) {
  const int reach = static_cast<int>(most / frame.resolution);
  std::vector<float> clearance(cells.size(), static_cast<float>(most));
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      double least = most / frame.resolution;
      for (int v = y - reach; v <= y + reach; ++v) {
        for (int u = x - reach; u <= x + reach; ++u) {
          if (frame.contains(u, v) && cells[frame.index(u, v)] == CellState::free) continue;
          least = std::min(least, std::hypot(u - x, v - y));
        }
      }
      clearance[frame.index(x, y)] = static_cast<float>(least * frame.resolution);
    }
  }
  return clearance;
}

/// A generated floor, the map of it that is all known, and where a robot can start.
struct KnownFloor {
  OccupancyGrid floor;
  FloorMap map;
  Eigen::Vector2d start;
};

inline KnownFloor known_floor(const std::string& plan, std::uint64_t seed) {
  Registry registry;
  KnownFloor known;
  known.floor = registry.make<FloorPlan>(parse_component(plan))->generate(seed);
  known.map.frame = known.floor.frame;
  for (const std::int8_t value : known.floor.occupancy) {
    const CellState state = CellThresholds{}.state(value);
    known.map.cells.push_back(state);
    known.map.log_odds.push_back(state == CellState::unknown ? 0.0F
                                 : state == CellState::free  ? -4.2F
                                                             : 4.2F);
  }
  known.map.clearance = capped_clearance(known.map.frame, known.map.cells, 0.6);
  known.start = registry.make<FloorSurveyor>(parse_component("round_body"))
                    ->survey(known.floor, {.radius = 0.2})
                    .start;
  return known;
}

}  // namespace cairn::test
