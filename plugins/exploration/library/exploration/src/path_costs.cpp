// SPDX-License-Identifier: BSD-3-Clause
#include "path_costs.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <queue>
#include <utility>

namespace cairn {
namespace {

using Eigen::Array2d;
using Eigen::Vector2d;

/// A metre costs so much more for each metre that it lies away from the path, up to the most [m].
constexpr double kAwayCost = 1.0, kMostAway = 1.0;

double distance_to_segment(const Vector2d& point, const Vector2d& a, const Vector2d& b) {
  const Vector2d along = b - a;
  const double squared = along.squaredNorm();
  const double part = squared > 0.0 ? std::clamp((point - a).dot(along) / squared, 0.0, 1.0) : 0.0;
  return (point - a - part * along).norm();
}

}  // namespace

PathCosts::PathCosts(const PlannedPath& path, const FloorMap& map, double needed_clearance,
                     const std::atomic<bool>* interrupt)
    : per_metre_(map.frame.size(), 1.0 + kAwayCost * kMostAway),
      to_end_(map.frame.size(), std::numeric_limits<double>::infinity()) {
  for (std::size_t k = 1; k < path.points.size(); ++k)
    add_segment(path.points[k - 1], path.points[k], map.frame);
  spread(path.points.back(), map, needed_clearance, interrupt);
}

/// Lowers the costs in the cells near a segment of the path.
void PathCosts::add_segment(const Vector2d& a, const Vector2d& b, const GridFrame& frame) {
  const Array2d from = frame.to_cells(a), to = frame.to_cells(b);
  const double aside = kMostAway / frame.resolution;
  const Array2d last(frame.width - 1, frame.height - 1);
  const Eigen::Array2i low = (from.min(to) - aside).floor().max(0.0).cast<int>();
  const Eigen::Array2i high = (from.max(to) + aside).floor().min(last).cast<int>();
  for (int y = low.y(); y <= high.y(); ++y) {
    for (int x = low.x(); x <= high.x(); ++x) {
      const double away = distance_to_segment(frame.centre(x, y), a, b);
      double& cost = per_metre_[frame.index(x, y)];
      cost = std::min(cost, 1.0 + kAwayCost * away);
    }
  }
}

/// Dijkstra's algorithm from the end. The end may be too near to an obstacle itself.
void PathCosts::spread(const Vector2d& end, const FloorMap& map, double needed_clearance,
                       const std::atomic<bool>* interrupt) {
  const GridFrame& frame = map.frame;
  const Eigen::Array2i cell = frame.to_cells(end).array().floor().cast<int>();
  if (!frame.contains(cell.x(), cell.y())) return;
  using Open = std::pair<double, std::size_t>;
  std::priority_queue<Open, std::vector<Open>, std::greater<>> open;
  open.push({0.0, frame.index(cell.x(), cell.y())});
  to_end_[open.top().second] = 0.0;
  while (!open.empty() && !(interrupt && interrupt->load(std::memory_order_relaxed))) {
    const auto [cost, index] = open.top();
    open.pop();
    if (cost > to_end_[index]) continue;
    const int x = static_cast<int>(index) % frame.width;
    const int y = static_cast<int>(index) / frame.width;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (!frame.contains(x + dx, y + dy)) continue;
        const std::size_t next = frame.index(x + dx, y + dy);
        if (map.clearance[next] < needed_clearance) continue;
        const double length = frame.resolution * (dx != 0 && dy != 0 ? std::numbers::sqrt2 : 1.0);
        const double there = cost + 0.5 * (per_metre_[index] + per_metre_[next]) * length;
        if (there >= to_end_[next]) continue;
        to_end_[next] = there;
        open.push({there, next});
      }
    }
  }
}

}  // namespace cairn
