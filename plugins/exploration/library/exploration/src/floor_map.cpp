// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/floor_map.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace cairn {
namespace {

/// −p ln p − (1 − p) ln(1 − p) of p with these log odds.
double cell_entropy(double log_odds) {
  const double magnitude = std::abs(log_odds);
  const double odds = std::exp(-magnitude);  // of the less probable of the two
  return std::log1p(odds) + magnitude * odds / (1.0 + odds);
}

/// `cell_entropy`, kept for values that were asked for lately: the cells of a map have few
/// different ones.
class RecentEntropies {
 public:
  double of(float log_odds) {
    const auto bits = std::bit_cast<std::uint32_t>(log_odds);
    Entry& entry = entries_[(bits * 2654435769U) >> (32 - kBits)];  // Fibonacci hashing
    if (entry.log_odds != log_odds) entry = {log_odds, cell_entropy(log_odds)};
    return entry.entropy;
  }

 private:
  static constexpr int kBits = 10;
  struct Entry {
    float log_odds = 0.0F;
    double entropy = std::numbers::ln2;
  };
  std::array<Entry, std::size_t{1} << kBits> entries_{};
};

}  // namespace

Mapper::~Mapper() = default;

std::size_t FloorMap::known_cells() const {
  return cells.size() - static_cast<std::size_t>(std::ranges::count(cells, CellState::unknown));
}

double FloorMap::entropy() const {
  RecentEntropies recent;
  double sum = 0.0;
  std::size_t unknown = 0;
  for (const float value : log_odds) {
    if (value == 0.0F)
      ++unknown;
    else
      sum += recent.of(value);
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
