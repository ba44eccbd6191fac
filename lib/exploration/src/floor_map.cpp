// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/floor_map.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cairn {
namespace {

/// −p ln p − (1 − p) ln(1 − p) of p with these log odds.
double cell_entropy(double log_odds) {
  const double magnitude = std::abs(log_odds);
  const double odds = std::exp(-magnitude);  // of the less probable of the two
  return std::log1p(odds) + magnitude * odds / (1.0 + odds);
}

}  // namespace

Mapper::~Mapper() = default;

std::size_t FloorMap::known_cells() const {
  return cells.size() - static_cast<std::size_t>(std::ranges::count(cells, CellState::unknown));
}

double FloorMap::entropy() const {
  double sum = 0.0;
  std::size_t unknown = 0;
  for (const float value : log_odds) {
    if (value == 0.0F)
      ++unknown;
    else
      sum += cell_entropy(value);
  }
  return frame.cell_area() * (sum + std::numbers::ln2 * static_cast<double>(unknown));
}

OccupancyGrid FloorMap::occupancy() const {
  OccupancyGrid grid{.frame = frame,
                     .occupancy = std::vector<std::int8_t>(cells.size(), kUnknownCell)};
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (cells[k] == CellState::unknown) continue;
    const double odds = std::exp(static_cast<double>(log_odds[k]));
    grid.occupancy[k] = static_cast<std::int8_t>(std::lround(100.0 * odds / (1.0 + odds)));
  }
  return grid;
}

}  // namespace cairn
