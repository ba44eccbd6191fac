// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/free_space.hpp"

#include <algorithm>
#include <array>

#include "cairn/exploration/path_planner.hpp"

namespace cairn {

using Eigen::Vector2d;

FreeSpace::FreeSpace(const FloorMap& map, const Vector2d& from, double radius)
    : map_(&map),
      needed_(needed_clearance(radius, map.frame)),
      before_(map.cells.size(), kOutside) {
  const std::int32_t start = cell_at(from);
  const std::int32_t first = start < 0 ? start : find_entry(start, from);
  if (first >= 0) spread(first);
}

std::int32_t FreeSpace::cell_at(const Vector2d& point) const {
  const GridFrame& frame = map_->frame;
  const Vector2d cell = frame.to_cells(point).array().floor();
  const bool on_it =
      cell.x() >= 0.0 && cell.y() >= 0.0 && cell.x() < frame.width && cell.y() < frame.height;
  if (!on_it) return -1;
  return static_cast<std::int32_t>(
      frame.index(static_cast<int>(cell.x()), static_cast<int>(cell.y())));
}

Vector2d FreeSpace::middle(std::int32_t cell) const {
  return map_->frame.centre(cell % map_->frame.width, cell / map_->frame.width);
}

template <class Visit>
void FreeSpace::for_each_neighbour(std::int32_t cell, Visit&& visit) const {
  constexpr std::array<std::array<int, 2>, 4> kSides{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
  const int x = cell % map_->frame.width, y = cell / map_->frame.width;
  for (const auto& [dx, dy] : kSides) {
    if (map_->frame.contains(x + dx, y + dy))
      visit(static_cast<std::int32_t>(map_->frame.index(x + dx, y + dy)));
  }
}

/// The nearest cell in which the body fits, by a breadth-first search over those in which it is no
/// nearer to obstacles than at its start; −1: there is none.
std::int32_t FreeSpace::find_entry(std::int32_t start, const Vector2d& from) {
  const float least = map_->clearance[static_cast<std::size_t>(start)];
  std::vector<std::int32_t> before(map_->cells.size(), -1), queue{start};
  before[static_cast<std::size_t>(start)] = start;
  std::int32_t found = -1;
  for (std::size_t head = 0; head < queue.size() && found < 0; ++head) {
    const std::int32_t cell = queue[head];
    if (fits(cell)) {
      found = cell;
      break;
    }
    for_each_neighbour(cell, [&](std::int32_t next) {
      const float clearance = map_->clearance[static_cast<std::size_t>(next)];
      std::int32_t& came_from = before[static_cast<std::size_t>(next)];
      if (came_from >= 0 || clearance <= 0.0F || clearance < least) return;
      came_from = cell;
      queue.push_back(next);
    });
  }
  if (found < 0) return found;
  for (std::int32_t cell = found; cell != start; cell = before[static_cast<std::size_t>(cell)])
    entry_.push_back(middle(cell));
  entry_.push_back(from);
  std::ranges::reverse(entry_);
  return found;
}

void FreeSpace::spread(std::int32_t start) {
  cells_.push_back(start);
  before_[static_cast<std::size_t>(start)] = -1;
  for (std::size_t head = 0; head < cells_.size(); ++head) {
    for_each_neighbour(cells_[head], [&](std::int32_t next) {
      if (contains(next) || !fits(next)) return;
      before_[static_cast<std::size_t>(next)] = cells_[head];
      cells_.push_back(next);
    });
  }
}

bool FreeSpace::contains(const Vector2d& point) const { return is_clear(point, point); }

bool FreeSpace::is_clear(const Vector2d& from, const Vector2d& to) const {
  const GridFrame& frame = map_->frame;
  return traverse_cells(frame.to_cells(from), frame.to_cells(to), [&](int x, int y) {
    return frame.contains(x, y) && contains(static_cast<std::int32_t>(frame.index(x, y)));
  });
}

Vector2d FreeSpace::sample(RandomNumbers& random) const {
  const std::int32_t cell = cells_[random.below(cells_.size())];
  const int x = cell % map_->frame.width, y = cell / map_->frame.width;
  const double right = random.uniform(), up = random.uniform();
  return map_->frame.to_world({x + right, y + up});
}

std::optional<Vector2d> FreeSpace::view_of(const Vector2d& goal, double tolerance) const {
  const std::int32_t cell =
      nearest_view(*map_, goal, tolerance, [&](std::int32_t index) { return contains(index); });
  if (cell < 0) return std::nullopt;
  return middle(cell);
}

}  // namespace cairn
