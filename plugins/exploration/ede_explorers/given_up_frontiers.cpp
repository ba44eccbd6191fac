// SPDX-License-Identifier: BSD-3-Clause
#include "given_up_frontiers.hpp"

#include <algorithm>

namespace cairn::exploration {
using Eigen::Vector2d;

void GivenUpFrontiers::add(const FloorMap& map, std::span<const SeenFrontier> seen) {
  for (const SeenFrontier& frontier : seen) {
    const int width = map.frame.width;
    const Vector2d at = map.frame.centre(frontier.cell % width, frontier.cell / width);
    const auto same = [&](const KnownSurroundings& cell) {
      return (cell.at() - at).norm() < 0.5 * map.frame.resolution;
    };
    if (std::ranges::none_of(cells_, same)) cells_.emplace_back(map, at);
  }
}

void GivenUpFrontiers::remove_from(std::vector<BeamCell>& cells, const FloorMap& map,
                                   double least) {
  std::erase_if(cells_, [&](const KnownSurroundings& cell) { return cell.more_in(map); });
  const auto block = [&](std::size_t cell) {
    if (cells[cell] == BeamCell::frontier) cells[cell] = BeamCell::opaque;
  };
  for (const KnownSurroundings& given_up : cells_) {
    const Vector2d cell = map.frame.to_cells(given_up.at()).array().floor();
    const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
    if (map.frame.contains(x, y)) block(map.frame.index(x, y));
  }
  for (const Frontier& frontier : map.frontiers) {
    if (frontier.length >= least) continue;
    for (const std::int32_t cell : frontier.cells) block(static_cast<std::size_t>(cell));
  }
}

}  // namespace cairn::exploration
