// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cairn/exploration/floor_map.hpp"

namespace cairn::test {

/// Rows from the top: '.' free, '#' occupied, anything else unknown.
inline OccupancyGrid drawn_floor(const std::vector<std::string>& rows, double resolution = 1.0) {
  OccupancyGrid grid{{.width = static_cast<int>(rows.front().size()),
                      .height = static_cast<int>(rows.size()),
                      .resolution = resolution},
                     {}};
  for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
    for (const char c : *row)
      grid.occupancy.push_back(c == '.' ? 0 : c == '#' ? 100 : kUnknownCell);
  }
  return grid;
}

/// By cell the distance [m] to the nearest one that is not free, or outside: by its definition.
inline std::vector<float> literal_clearance(const GridFrame& frame,
                                            const std::vector<CellState>& cells) {
  std::vector<float> clearance(cells.size());
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      double least = std::numeric_limits<double>::infinity();
      for (int v = -1; v <= frame.height; ++v) {
        for (int u = -1; u <= frame.width; ++u) {
          if (frame.contains(u, v) && cells[frame.index(u, v)] == CellState::free) continue;
          least = std::min(least, std::hypot(u - x, v - y));
        }
      }
      clearance[frame.index(x, y)] = static_cast<float>(least * frame.resolution);
    }
  }
  return clearance;
}

/// A map of such a floor, without frontiers.
inline FloorMap drawn_map(const std::vector<std::string>& rows, double resolution = 1.0) {
  const OccupancyGrid grid = drawn_floor(rows, resolution);
  FloorMap map;
  map.frame = grid.frame;
  for (const std::int8_t value : grid.occupancy) {
    const CellState state = CellThresholds{}.state(value);
    map.cells.push_back(state);
    map.log_odds.push_back(state == CellState::unknown ? 0.0F
                           : state == CellState::free  ? -2.0F
                                                       : 2.0F);
  }
  map.clearance = literal_clearance(map.frame, map.cells);
  return map;
}

}  // namespace cairn::test
