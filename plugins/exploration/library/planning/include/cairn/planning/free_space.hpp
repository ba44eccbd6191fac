// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// The cell nearest to a point for which `is_reached(index)`, of those from whose middle nothing
/// but free cells lies on the line to it; −1: there is none within `tolerance` [m].
template <class Reached>
std::int32_t nearest_view(const FloorMap& map, const Eigen::Vector2d& goal, double tolerance,
                          Reached&& is_reached) {
  const GridFrame& frame = map.frame;
  const Eigen::Vector2d cell = frame.to_cells(goal).array().floor();
  const int reach = static_cast<int>(tolerance / frame.resolution);
  const int middle_x = static_cast<int>(cell.x()), middle_y = static_cast<int>(cell.y());
  const auto sees_goal = [&](int x, int y) {
    return traverse_cells(
        Eigen::Vector2d(x + 0.5, y + 0.5), frame.to_cells(goal), [&](int u, int v) {
          return frame.contains(u, v) && map.cells[frame.index(u, v)] == CellState::free;
        });
  };
  std::int32_t best = -1;
  double least = tolerance;
  for (int y = middle_y - reach; y <= middle_y + reach; ++y) {
    for (int x = middle_x - reach; x <= middle_x + reach; ++x) {
      if (!frame.contains(x, y)) continue;
      const auto index = static_cast<std::int32_t>(frame.index(x, y));
      const double apart = (frame.centre(x, y) - goal).norm();
      if (apart < least && is_reached(index) && sees_goal(x, y)) {
        best = index;
        least = apart;
      }
    }
  }
  return best;
}

/// Where the centre of a round body can be on the known floor, and get to from where it is: free
/// cells that have `needed_clearance`, and hang together by their sides.
class CAIRN_API FreeSpace {
 public:
  /// The map must outlive it. `from`: where the body is [m]; `radius`: of the body [m].
  FreeSpace(const FloorMap& map, const Eigen::Vector2d& from, double radius);

  /// The points that lead from where the body is to where it fits: that point alone, if it fits
  /// there. A body too near to an obstacle leaves it, coming no nearer. Empty: there is no way.
  const std::vector<Eigen::Vector2d>& entry() const { return entry_; }
  bool empty() const { return cells_.empty(); }
  double area() const { return static_cast<double>(cells_.size()) * map_->frame.cell_area(); }
  bool contains(std::int32_t cell) const {
    return before_[static_cast<std::size_t>(cell)] != kOutside;
  }
  bool contains(const Eigen::Vector2d& point) const;
  /// Whether all cells that the segment between two points enters belong to it.
  bool is_clear(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;
  /// A point of it, uniformly. It must not be empty.
  Eigen::Vector2d sample(RandomNumbers& random) const;
  /// Calls `visit(middle)` with the middles of the cells [m] from that of a point back to where the
  /// body is or enters, each beside the one before, until it returns false.
  template <class Visit>
  void trace_back(const Eigen::Vector2d& point, Visit&& visit) const {
    for (std::int32_t cell = cell_at(point); cell >= 0 && visit(middle(cell));
         cell = before_[static_cast<std::size_t>(cell)]) {
    }
  }
  /// The middle of the cell that is nearest to a goal and sees it; none: `nearest_view`.
  std::optional<Eigen::Vector2d> view_of(const Eigen::Vector2d& goal, double tolerance) const;

  const FloorMap& map() const { return *map_; }

 private:
  static constexpr std::int32_t kOutside = -2;

  std::int32_t cell_at(const Eigen::Vector2d& point) const;
  std::int32_t find_entry(std::int32_t start, const Eigen::Vector2d& from);
  void spread(std::int32_t start);
  bool fits(std::int32_t cell) const {
    return map_->clearance[static_cast<std::size_t>(cell)] >= needed_;
  }
  template <class Visit>
  void for_each_neighbour(std::int32_t cell, Visit&& visit) const;
  Eigen::Vector2d middle(std::int32_t cell) const;

  const FloorMap* map_;
  double needed_;  ///< clearance [m]
  std::vector<Eigen::Vector2d> entry_;
  /// By cell the one from which it was found; −1: the first one; −2: it does not belong to it.
  std::vector<std::int32_t> before_;
  std::vector<std::int32_t> cells_;
};

}  // namespace cairn
