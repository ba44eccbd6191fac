// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What a ray meets.
struct RayHit {
  double range = 0.0;  ///< [m] to where it enters the cell, or as far as it was cast
  int x = 0, y = 0;    ///< the cell that stops it: the first one outside, if it leaves the grid
  bool hit = false;    ///< false: nothing stops it within the range
};

/// Rays over the cells of a grid, as a lidar's. Every cell that is not free stops them, and so does
/// what lies outside the grid. The cell is that of exact traversal, which visits each cell that the
/// ray enters, in order (Amanatides and Woo 1987; through a corner it goes along x first); but
/// where all cells in a square around the ray are free it leaps to the square's border, by the
/// chessboard distance to the nearest cell that stops rays.
class CAIRN_API RayCaster {
 public:
  /// Time and 2 bytes per cell. Throws `Error` (input) as `check_frame` does.
  explicit RayCaster(const OccupancyGrid& grid, const CellThresholds& thresholds = {});

  /// From a point of the world [m], at an angle to its x axis [rad], up to `range` [m]. Where that
  /// point is not on the grid, or is no number, the ray is stopped at once.
  RayHit cast(const Eigen::Vector2d& from, double angle, double range) const;
  /// The same, cell by cell: to compare with.
  RayHit cast_plainly(const Eigen::Vector2d& from, double angle, double range) const;

 private:
  template <bool leaps>
  RayHit traverse(const Eigen::Vector2d& from, double angle, double range) const;

  GridFrame frame_;
  /// By cell the chessboard distance to the nearest cell that stops rays; 0: this one does.
  std::vector<std::uint16_t> distance_;
};

}  // namespace cairn
