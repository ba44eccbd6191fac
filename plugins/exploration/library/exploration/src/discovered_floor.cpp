// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/discovered_floor.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cairn {
namespace {

using Eigen::Vector2i;

constexpr double kSide = 0.3;  // of a square, about [m]

/// Rounded down, also below zero.
int divided(int number, int by) { return (number >= 0 ? number : number - by + 1) / by; }

}  // namespace

bool DiscoveredFloor::grows(const FloorMap& map) {
  const GridFrame& frame = map.frame;
  if (frame.size() == 0) return false;
  const int side = std::max(1, static_cast<int>(std::lround(kSide / frame.resolution)));
  const Vector2i origin = (frame.origin / frame.resolution).array().round().cast<int>();
  const auto square = [&](int x, int y) {
    return Vector2i(divided(origin.x() + x, side), divided(origin.y() + y, side));
  };
  cover(square(0, 0), square(frame.width - 1, frame.height - 1));
  const Vector2i shift = origin - side * low_;
  std::ranges::fill(known_, 0);
  for (int y = 0; y < frame.height; ++y) {
    const CellState* cells = &map.cells[frame.index(0, y)];
    int* row = &known_[index(0, (shift.y() + y) / side)];
    for (int x = 0, column = shift.x() / side; x < frame.width; ++column) {
      const int end = std::min(frame.width, side * (column + 1) - shift.x());
      for (; x < end; ++x) row[column] += cells[x] != CellState::unknown;
    }
  }
  bool grown = false;
  for (std::size_t k = 0; k < known_.size(); ++k) {
    if (ever_[k] != 0 || 2 * known_[k] < side * side) continue;
    ever_[k] = 1;
    grown = true;
  }
  return grown;
}

/// Makes room for squares up to these corners.
void DiscoveredFloor::cover(const Vector2i& low, const Vector2i& high) {
  const Vector2i last = low_ + size_ - Vector2i::Ones();
  const bool is_empty = ever_.empty();
  if (!is_empty && (low.array() >= low_.array()).all() && (high.array() <= last.array()).all())
    return;
  const DiscoveredFloor before = *this;
  low_ = is_empty ? low : Vector2i(low.cwiseMin(low_));
  size_ = (is_empty ? high : Vector2i(high.cwiseMax(last))) - low_ + Vector2i::Ones();
  ever_.assign(static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()), 0);
  known_.assign(ever_.size(), 0);
  const Vector2i shift = before.low_ - low_;
  for (int y = 0; y < before.size_.y(); ++y) {
    std::copy_n(&before.ever_[before.index(0, y)], before.size_.x(),
                &ever_[index(shift.x(), y + shift.y())]);
  }
}

std::size_t DiscoveredFloor::index(int x, int y) const {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.x()) +
         static_cast<std::size_t>(x);
}

}  // namespace cairn
