// SPDX-License-Identifier: BSD-3-Clause
#include "discovery.hpp"

#include <algorithm>
#include <utility>

#include "cairn/planning/seen_cells.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

bool is_known(const FloorMap& map, const Vector2d& point) {
  const Vector2d cell = map.frame.to_cells(point).array().floor();
  const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
  return map.frame.contains(x, y) && map.cells[map.frame.index(x, y)] != CellState::unknown;
}

}  // namespace

void Discovery::expect(std::vector<Vector2d> cells, double part) {
  expected_ = std::move(cells);
  part_ = part;
}

bool Discovery::is_done(const FloorMap& map) const {
  if (expected_.empty() || part_ >= 1.0) return false;
  const auto known =
      std::ranges::count_if(expected_, [&](const Vector2d& point) { return is_known(map, point); });
  return static_cast<double>(known) >= part_ * static_cast<double>(expected_.size());
}

const std::vector<Vector2d>& Discovery::not_found(const Situation& situation, double range) {
  const LidarModel& lidar = situation.robot.lidar;
  SeenCells seen(situation.map, lidar, std::min(range, lidar.range));
  seen.leave_out(not_found_);
  driven_.push_back(situation.pose);
  CellSet cells = seen.none();
  for (const Pose2& pose : driven_) cells.add(seen.look({&pose, 1}));
  driven_.clear();
  const std::vector<Vector2d> more = seen.middles(cells);
  not_found_.insert(not_found_.end(), more.begin(), more.end());
  return not_found_;
}

}  // namespace cairn::exploration
