// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "exploration/library/exploration/drawn_map.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {

/// Free cells beside unknown ones, corners included, become the map's frontier.
inline void add_frontiers(FloorMap& map) {
  Frontier frontier;
  const auto unknown = [&](int x, int y) {
    return !map.frame.contains(x, y) || map.cells[map.frame.index(x, y)] == CellState::unknown;
  };
  for (int y = 0; y < map.frame.height; ++y) {
    for (int x = 0; x < map.frame.width; ++x) {
      if (map.cells[map.frame.index(x, y)] != CellState::free) continue;
      bool beside = false;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) beside = beside || unknown(x + dx, y + dy);
      if (beside) frontier.cells.push_back(static_cast<std::int32_t>(map.frame.index(x, y)));
    }
  }
  frontier.length = map.frame.resolution * static_cast<double>(frontier.cells.size());
  map.frontiers.assign(1, std::move(frontier));
}

/// Rectangles of known floor with blocks in it, amid unknown cells.
inline FloorMap random_map(Draw& draw, int width, int height, double resolution, int rooms = 3) {
  std::vector<std::string> rows(static_cast<std::size_t>(height),
                                std::string(static_cast<std::size_t>(width), '?'));
  const auto fill = [&](char with, int least, int most) {
    const int w = static_cast<int>(draw.uniform(least, most));
    const int h = static_cast<int>(draw.uniform(least, most));
    const int x0 = static_cast<int>(draw.uniform(0.0, width - w));
    const int y0 = static_cast<int>(draw.uniform(0.0, height - h));
    for (int y = y0; y < y0 + h; ++y)
      for (int x = x0; x < x0 + w; ++x)
        rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] = with;
  };
  for (int k = 0; k < rooms; ++k) fill('.', std::min(width, height) / 2, std::min(width, height));
  for (int k = 0; k < 4 * rooms; ++k) fill('#', 2, 6);
  FloorMap map = drawn_map(rows, resolution);
  add_frontiers(map);
  return map;
}

}  // namespace cairn::test
