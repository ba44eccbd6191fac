// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/known_surroundings.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

using Eigen::Vector2d;

constexpr double kReach = 1.0;  // along each axis [m]
constexpr double kMore = 0.05;

int cells_within_reach(const FloorMap& map) {
  return std::max(1, static_cast<int>(kReach / map.frame.resolution));
}

std::size_t known_around(const FloorMap& map, const Vector2d& at) {
  const Vector2d cell = map.frame.to_cells(at).array().floor();
  const int reach = cells_within_reach(map);
  const int middle_x = static_cast<int>(cell.x()), middle_y = static_cast<int>(cell.y());
  std::size_t known = 0;
  for (int y = middle_y - reach; y <= middle_y + reach; ++y) {
    for (int x = middle_x - reach; x <= middle_x + reach; ++x)
      known += map.frame.contains(x, y) && map.cells[map.frame.index(x, y)] != CellState::unknown;
  }
  return known;
}

}  // namespace

KnownSurroundings::KnownSurroundings(const FloorMap& map, const Vector2d& at)
    : at_(at), known_(known_around(map, at)) {}

bool KnownSurroundings::same_as(const FloorMap& map) const {
  return known_around(map, at_) == known_;
}

bool KnownSurroundings::more_in(const FloorMap& map) const {
  const auto side = static_cast<double>(2 * cells_within_reach(map) + 1);
  return known_around(map, at_) > known_ + static_cast<std::size_t>(kMore * side * side);
}

}  // namespace cairn
