// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <vector>

namespace cairn::plot {

/// In the world [m].
struct Point {
  double x = 0, y = 0;
  bool there() const { return std::isfinite(x) && std::isfinite(y); }
};

/// A box that grows with what is added to it.
struct Bounds {
  double x0 = std::numeric_limits<double>::infinity(), x1 = -x0, y0 = x0, y1 = -x0;

  void add(const Point& point);
  void add(const std::vector<Point>& points);
  bool empty() const { return x0 > x1; }
  double size() const;
};

}  // namespace cairn::plot
