// SPDX-License-Identifier: BSD-3-Clause
#include "bounds.hpp"

#include <algorithm>

namespace cairn::plot {

void Bounds::add(const Point& point) {
  if (!point.there()) return;
  x0 = std::min(x0, point.x);
  x1 = std::max(x1, point.x);
  y0 = std::min(y0, point.y);
  y1 = std::max(y1, point.y);
}

void Bounds::add(const std::vector<Point>& points) {
  for (const Point& point : points) add(point);
}

double Bounds::size() const { return std::max(x1 - x0, y1 - y0); }

}  // namespace cairn::plot
