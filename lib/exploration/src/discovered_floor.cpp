// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/discovered_floor.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cairn {
namespace {

constexpr double kSide = 0.3;  // of a square [m]

}  // namespace

bool DiscoveredFloor::grows(const FloorMap& map) {
  const GridFrame& frame = map.frame;
  const double side = std::max(kSide, frame.resolution);
  const auto square = [&](double metres) { return static_cast<int>(std::floor(metres / side)); };
  const auto column = [&](int x) { return square(frame.centre(x, 0).x()); };
  const int first_x = column(0), first_y = square(frame.origin.y());
  const int width = column(frame.width - 1) - first_x + 1;
  const int height = square(frame.centre(0, frame.height - 1).y()) - first_y + 1;
  known_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  std::vector<int> columns(static_cast<std::size_t>(frame.width));
  for (int x = 0; x < frame.width; ++x) columns[static_cast<std::size_t>(x)] = column(x) - first_x;
  for (int y = 0; y < frame.height; ++y) {
    int* row = &known_[static_cast<std::size_t>(square(frame.centre(0, y).y()) - first_y) *
                       static_cast<std::size_t>(width)];
    const CellState* cells = &map.cells[frame.index(0, y)];
    for (int x = 0; x < frame.width; ++x)
      row[columns[static_cast<std::size_t>(x)]] += cells[x] != CellState::unknown;
  }
  const double half = 0.5 * side * side / frame.cell_area();
  bool grown = false;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto k = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(x);
      if (known_[k] < half) continue;
      const auto key = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(first_x + x)) << 32) |
                       static_cast<std::uint32_t>(first_y + y);
      grown |= squares_.insert(key).second;
    }
  }
  return grown;
}

}  // namespace cairn
