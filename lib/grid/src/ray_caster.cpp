// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/ray_caster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn {
namespace {

/// Where a ray crosses the borders of cells along one axis. Lengths are in cells.
class Crossings {
 public:
  Crossings(double from, double direction)
      : first_(std::floor(from)), from_(from), direction_(direction), inverse_(1.0 / direction) {}

  int cell(int count) const {
    return static_cast<int>(first_) + (direction_ < 0.0 ? -count : count);
  }
  /// The length of the ray at crossing `count` = 1, 2, …
  double at(int count) const {
    if (direction_ == 0.0) return std::numeric_limits<double>::infinity();
    const double border = direction_ > 0.0 ? first_ + count : first_ + 1.0 - count;
    return (border - from_) * inverse_;
  }
  /// How many crossings, of `low` to `high`, are before `length`, or also at it.
  int before(double length, bool also_at, int low, int high) const {
    if (direction_ == 0.0) return low;
    const double coordinate = from_ + direction_ * length;
    const double guess = direction_ > 0.0 ? coordinate - first_ : first_ + 1.0 - coordinate;
    int count = static_cast<int>(std::clamp(guess, double(low), double(high)));
    const auto passed = [&](int k) { return also_at ? at(k) <= length : at(k) < length; };
    while (count > low && !passed(count)) --count;
    while (count < high && passed(count + 1)) ++count;
    return count;
  }

 private:
  double first_, from_, direction_, inverse_;
};

/// The chessboard distance to the nearest zero by two passes, each from the neighbours that it has
/// seen; what lies outside is zero.
void to_chessboard_distance(const GridFrame& frame, std::vector<std::uint16_t>& cells) {
  const auto value = [&](int x, int y) -> int {
    return frame.contains(x, y) ? cells[frame.index(x, y)] : 0;
  };
  const auto lower = [&](int x, int y, int side) {
    const int least = std::min(
        {value(x - side, y), value(x - 1, y - side), value(x, y - side), value(x + 1, y - side)});
    std::uint16_t& cell = cells[frame.index(x, y)];
    cell = static_cast<std::uint16_t>(
        std::min<int>({cell, least + 1, std::numeric_limits<std::uint16_t>::max()}));
  };
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) lower(x, y, 1);
  }
  for (int y = frame.height - 1; y >= 0; --y) {
    for (int x = frame.width - 1; x >= 0; --x) lower(x, y, -1);
  }
}

}  // namespace

RayCaster::RayCaster(const OccupancyGrid& grid, const CellThresholds& thresholds)
    : frame_(grid.frame), distance_(grid.occupancy.size()) {
  check_frame(frame_, "ray casting");
  std::ranges::transform(grid.occupancy, distance_.begin(), [&](std::int8_t value) {
    const bool free = thresholds.state(value) == CellState::free;
    return free ? std::numeric_limits<std::uint16_t>::max() : std::uint16_t{0};
  });
  to_chessboard_distance(frame_, distance_);
}

template <bool leaps>
RayHit RayCaster::traverse(const Eigen::Vector2d& from, double angle, double range) const {
  const Eigen::Vector2d start = frame_.to_cells(from);
  const double length = range / frame_.resolution;
  // Farther away there are no cells, and numbers of cells are no integers any more.
  constexpr double kFar = 1e9;
  if (!(start.array().abs() < kFar).all() || !std::isfinite(angle))
    return {.range = 0.0, .x = -1, .y = -1, .hit = true};
  const Crossings along_x(start.x(), std::cos(angle - frame_.yaw)),
      along_y(start.y(), std::sin(angle - frame_.yaw));
  int m = 0, n = 0;  // crossings so far
  double at = 0.0;
  while (true) {
    const int x = along_x.cell(m), y = along_y.cell(n);
    const int room = frame_.contains(x, y) ? distance_[frame_.index(x, y)] : 0;
    if (room == 0) return {.range = at * frame_.resolution, .x = x, .y = y, .hit = true};
    const int step = leaps ? room : 1;
    const double next_x = along_x.at(m + step), next_y = along_y.at(n + step);
    at = std::min(next_x, next_y);
    if (!(at <= length)) return {.range = range, .x = x, .y = y, .hit = false};
    if (next_x <= next_y) {
      n = along_y.before(at, false, n, n + step - 1);
      m += step;
    } else {
      m = along_x.before(at, true, m, m + step - 1);
      n += step;
    }
  }
}

RayHit RayCaster::cast(const Eigen::Vector2d& from, double angle, double range) const {
  return traverse<true>(from, angle, range);
}

RayHit RayCaster::cast_plainly(const Eigen::Vector2d& from, double angle, double range) const {
  return traverse<false>(from, angle, range);
}

}  // namespace cairn
