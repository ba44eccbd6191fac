// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Whether no known obstacle stands between two poses.
inline bool in_sight(const FloorMap& map, const Pose2& older, const Pose2& newer) {
  const GridFrame& frame = map.frame;
  if (frame.size() == 0) return true;  // nothing is known, not even how large a cell is
  return traverse_cells(
      frame.to_cells(older.translation()), frame.to_cells(newer.translation()), [&](int x, int y) {
        return !frame.contains(x, y) || map.cells[frame.index(x, y)] != CellState::occupied;
      });
}

}  // namespace cairn
