// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdlib>
#include <limits>

#include <Eigen/Core>

namespace cairn {

/// Calls `visit(x, y)` for each cell that the segment between two points enters, in order, until it
/// returns false (Amanatides and Woo 1987). Points are in cells (`GridFrame::to_cells`), and less
/// than 1e9 away from the origin. Returns false if it was stopped.
template <class Visit>
bool traverse_cells(const Eigen::Vector2d& from, const Eigen::Vector2d& to, Visit&& visit) {
  const Eigen::Vector2d apart = to - from;
  int x = static_cast<int>(std::floor(from.x())), y = static_cast<int>(std::floor(from.y()));
  const int end_x = static_cast<int>(std::floor(to.x()));
  const int end_y = static_cast<int>(std::floor(to.y()));
  const int step_x = apart.x() > 0.0 ? 1 : -1, step_y = apart.y() > 0.0 ? 1 : -1;
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const double per_x = apart.x() == 0.0 ? kNever : 1.0 / std::abs(apart.x());
  const double per_y = apart.y() == 0.0 ? kNever : 1.0 / std::abs(apart.y());
  // The part of the segment at which it crosses the next border of cells.
  double next_x =
      apart.x() == 0.0 ? kNever : (apart.x() > 0.0 ? x + 1.0 - from.x() : from.x() - x) * per_x;
  double next_y =
      apart.y() == 0.0 ? kNever : (apart.y() > 0.0 ? y + 1.0 - from.y() : from.y() - y) * per_y;
  for (int left = std::abs(end_x - x) + std::abs(end_y - y); left >= 0; --left) {
    if (!visit(x, y)) return false;
    if (next_x <= next_y) {
      x += step_x;
      next_x += per_x;
    } else {
      y += step_y;
      next_y += per_y;
    }
  }
  return true;
}

}  // namespace cairn
