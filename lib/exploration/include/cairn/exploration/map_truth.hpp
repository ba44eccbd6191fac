// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/laser_scan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// A map beside the floor that it is of [m²]. Cells of the map are compared with the cell of the
/// floor in which their middle lies.
struct MapTruth {
  double floor = 0.0;       ///< free floor that hangs together with the start, over sides of cells
  double seen = 0.0;        ///< of that, what the map knows
  double free_wrong = 0.0;  ///< free in the map, an obstacle of the floor
  double occupied_wrong = 0.0;  ///< occupied in the map; free on the floor, and not beside a wall
};

/// Compares a map with the floor. `alignment` takes points of the map's world to that of the floor;
/// `start` is a point of the floor [m].
CAIRN_API MapTruth compare_with_floor(const FloorMap& map, const OccupancyGrid& floor,
                                      const Pose2& alignment, const Eigen::Vector2d& start);

/// Cells of the map that are free though an end point of a scan lies in them, each once [m²]: the
/// "map error" of the thesis (5.4.5) without knowledge of the truth.
CAIRN_API double contradicted_area(const FloorMap& map, std::span<const LaserScan> scans,
                                   std::span<const Pose2> poses);

}  // namespace cairn
