// SPDX-License-Identifier: BSD-3-Clause
#include "given_up_frontiers.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

/// Half the side of the square around a cell that counts [m], and the part of it that must have
/// become known since.
constexpr double kAround = 1.0;
constexpr double kGrown = 0.05;

int reach_of(const FloorMap& map) {
  return std::max(1, static_cast<int>(kAround / map.frame.resolution));
}

std::size_t known_around(const FloorMap& map, const Vector2d& at) {
  const Vector2d cell = map.frame.to_cells(at).array().floor();
  const int reach = reach_of(map);
  std::size_t known = 0;
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const int x = static_cast<int>(cell.x()) + dx, y = static_cast<int>(cell.y()) + dy;
      known += map.frame.contains(x, y) && map.cells[map.frame.index(x, y)] != CellState::unknown;
    }
  }
  return known;
}

}  // namespace

void GivenUpFrontiers::add(const FloorMap& map, std::span<const SeenFrontier> seen) {
  for (const SeenFrontier& frontier : seen) {
    const int width = map.frame.width;
    const Vector2d at = map.frame.centre(frontier.cell % width, frontier.cell / width);
    const auto same = [&](const Cell& cell) {
      return (cell.at - at).norm() < 0.5 * map.frame.resolution;
    };
    if (std::ranges::none_of(cells_, same)) cells_.push_back({at, known_around(map, at)});
  }
}

void GivenUpFrontiers::remove_from(std::vector<BeamCell>& cells, const FloorMap& map,
                                   double least) {
  const auto side = static_cast<double>(2 * reach_of(map) + 1);
  const auto grown = static_cast<std::size_t>(kGrown * side * side);
  std::erase_if(cells_,
                [&](const Cell& cell) { return known_around(map, cell.at) > cell.known + grown; });
  const auto block = [&](std::size_t cell) {
    if (cells[cell] == BeamCell::frontier) cells[cell] = BeamCell::opaque;
  };
  for (const Cell& given_up : cells_) {
    const Vector2d cell = map.frame.to_cells(given_up.at).array().floor();
    const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
    if (map.frame.contains(x, y)) block(map.frame.index(x, y));
  }
  for (const Frontier& frontier : map.frontiers) {
    if (frontier.length >= least) continue;
    for (const std::int32_t cell : frontier.cells) block(static_cast<std::size_t>(cell));
  }
}

}  // namespace cairn::exploration
