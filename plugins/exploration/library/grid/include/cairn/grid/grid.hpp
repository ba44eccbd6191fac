// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Where the square cells of a grid are in the world. Cell (0, 0) is the lower left one, x counts
/// columns to the right, y rows upwards; `index` counts row by row.
struct GridFrame {
  int width = 0, height = 0;                         ///< cells
  double resolution = 0.0;                           ///< side of a cell [m]
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< lower left corner of cell (0, 0) [m]
  double yaw = 0.0;  ///< by which the grid is turned about that corner [rad]

  std::int64_t size() const { return std::int64_t{width} * height; }
  double cell_area() const { return resolution * resolution; }  ///< [m²]
  bool contains(int x, int y) const { return x >= 0 && x < width && y >= 0 && y < height; }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
  /// A point of the world [m] in cells from the origin: cell (x, y) holds [x, x + 1) × [y, y + 1).
  Eigen::Vector2d to_cells(const Eigen::Vector2d& world) const {
    return turned(world - origin, -yaw) / resolution;
  }
  Eigen::Vector2d to_world(const Eigen::Vector2d& cells) const {
    return origin + turned(cells * resolution, yaw);
  }
  /// The middle of a cell in the world [m].
  Eigen::Vector2d centre(int x, int y) const { return to_world({x + 0.5, y + 0.5}); }

 private:
  static Eigen::Vector2d turned(const Eigen::Vector2d& v, double angle) {
    if (angle == 0.0) return v;  // as most grids are
    const double c = std::cos(angle), s = std::sin(angle);
    return {c * v.x() - s * v.y(), s * v.x() + c * v.y()};
  }
};

/// Cells with the probability of being occupied in per cent, 0 to 100, or `kUnknownCell`: what ROS'
/// messages of type nav_msgs/OccupancyGrid hold.
struct OccupancyGrid {
  GridFrame frame;
  std::vector<std::int8_t> occupancy;  ///< by `GridFrame::index`
};
inline constexpr std::int8_t kUnknownCell = -1;

enum class CellState : std::uint8_t { free, occupied, unknown };

/// Of a probability in per cent: at most `free` is free, at least `occupied` is occupied, anything
/// in between is unknown.
struct CellThresholds {
  int free = 25, occupied = 65;

  CellState state(std::int8_t occupancy) const {
    if (occupancy < 0) return CellState::unknown;
    if (occupancy <= free) return CellState::free;
    return occupancy >= occupied ? CellState::occupied : CellState::unknown;
  }
};

/// Throws `Error` (input), beginning with `name`, for a frame without cells or with more than 10⁸,
/// a resolution that is not between 10⁻⁶ and 10⁶ m, or an origin that is not within ±10⁹ m.
CAIRN_API void check_frame(const GridFrame& frame, std::string_view name);

}  // namespace cairn
