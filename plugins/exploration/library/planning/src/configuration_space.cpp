// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/configuration_space.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <queue>
#include <utility>

#include <fmt/core.h>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

/// Dijkstra's algorithm over the cells of a map, from one of them.
class PathLengths {
 public:
  PathLengths(const FloorMap& map, const ConfigurationSpace& space)
      : map_(map), space_(space), length_(map.cells.size(), kFar) {}

  void spread(int x, int y) {
    least_ = map_.clearance[map_.frame.index(x, y)];
    lower(x, y, 0.0F);
    while (!open_.empty()) {
      const auto [length, cell] = open_.top();
      open_.pop();
      if (length == length_[static_cast<std::size_t>(cell)])
        visit_neighbours(cell % map_.frame.width, cell / map_.frame.width, length);
    }
  }
  float at(std::int32_t cell) const { return length_[static_cast<std::size_t>(cell)]; }

 private:
  void visit_neighbours(int x, int y, float length) {
    const auto side = static_cast<float>(map_.frame.resolution);
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (!passable(x, y, dx, dy)) continue;
        const bool diagonal = dx != 0 && dy != 0;
        lower(x + dx, y + dy, length + (diagonal ? std::numbers::sqrt2_v<float> * side : side));
      }
    }
  }

  /// Diagonally only where the body may be on both sides.
  bool passable(int x, int y, int dx, int dy) const {
    if (dx == 0 && dy == 0) return false;
    const bool leaving = space_.number(x, y) < 0;
    const auto open = [&](int u, int v) {
      if (space_.number(u, v) >= 0) return true;
      if (!leaving || !map_.frame.contains(u, v)) return false;
      const float clearance = map_.clearance[map_.frame.index(u, v)];
      return clearance > 0.0F && clearance >= least_;
    };
    return open(x + dx, y + dy) && (dx == 0 || dy == 0 || (open(x + dx, y) && open(x, y + dy)));
  }

  void lower(int x, int y, float length) {
    const std::size_t cell = map_.frame.index(x, y);
    if (length >= length_[cell]) return;
    length_[cell] = length;
    open_.emplace(length, static_cast<std::int32_t>(cell));
  }

  const FloorMap& map_;
  const ConfigurationSpace& space_;
  std::vector<float> length_;
  float least_ = 0.0F;  ///< clearance at the start [m]
  using Entry = std::pair<float, std::int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open_;
};

}  // namespace

ConfigurationSpace::ConfigurationSpace(const FloorMap& map, double radius, int orientations)
    : frame_(map.frame), orientations_(orientations), numbers_(map.cells.size(), -1) {
  if (orientations < 1)
    throw Error(ErrorCode::usage, "a configuration space needs at least one orientation");
  const double needed = needed_clearance(radius, map.frame);
  for (std::size_t cell = 0; cell < map.cells.size(); ++cell) {
    if (map.cells[cell] != CellState::free || map.clearance[cell] < needed) continue;
    numbers_[cell] = static_cast<std::int32_t>(cells_.size());
    cells_.push_back(static_cast<std::int32_t>(cell));
  }
  if (size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    throw Error(ErrorCode::usage,
                fmt::format("{} free cells with {} orientations are more than 2³¹ configurations: "
                            "take larger cells or fewer orientations",
                            cells_.size(), orientations));
  }
}

double ConfigurationSpace::heading(int orientation) const {
  return 2.0 * std::numbers::pi * orientation / orientations_;
}

Eigen::Vector2d ConfigurationSpace::position(std::int32_t number) const {
  const std::int32_t cell = cells_[static_cast<std::size_t>(number)];
  return frame_.centre(cell % frame_.width, cell / frame_.width);
}

Pose2 ConfigurationSpace::pose(std::size_t configuration) const {
  const Eigen::Vector2d at = position(number_of(configuration));
  return {at.x(), at.y(), heading(orientation_of(configuration))};
}

std::optional<std::size_t> ConfigurationSpace::nearest(const Pose2& pose) const {
  const Eigen::Vector2d cell = frame_.to_cells(pose.translation()).array().floor();
  const std::int32_t found = number(static_cast<int>(cell.x()), static_cast<int>(cell.y()));
  if (found < 0) return std::nullopt;
  const double turns = pose.theta() / (2.0 * std::numbers::pi);
  return index(found, static_cast<int>(std::lround(turns * orientations_)));
}

std::vector<float> path_lengths(const ConfigurationSpace& space, const FloorMap& map,
                                const Eigen::Vector2d& from) {
  PathLengths lengths(map, space);
  const Eigen::Vector2d cell = map.frame.to_cells(from).array().floor();
  const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
  if (map.frame.contains(x, y)) lengths.spread(x, y);
  std::vector<float> result;
  result.reserve(space.cells().size());
  for (const std::int32_t at : space.cells()) result.push_back(lengths.at(at));
  return result;
}

}  // namespace cairn
