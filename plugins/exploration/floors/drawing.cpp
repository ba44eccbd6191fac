// SPDX-License-Identifier: BSD-3-Clause
#include "drawing.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/runtime/error.hpp"

namespace cairn::floors {

Drawing::Drawing(const PlanOptions& options) {
  grid_.frame.resolution = options.resolution;
  grid_.frame.width = cells(options.width);
  grid_.frame.height = cells(options.height);
  check_frame(grid_.frame, "floor plan");
  grid_.occupancy.assign(static_cast<std::size_t>(grid_.frame.size()), 100);
}

int Drawing::cells(double length) const {
  return std::max(1, static_cast<int>(std::lround(length / grid_.frame.resolution)));
}

void Drawing::fill(const Box& box, bool free) {
  for (int y = std::max(0, box.y0); y < std::min(height(), box.y1); ++y) {
    for (int x = std::max(0, box.x0); x < std::min(width(), box.x1); ++x) set(x, y, free);
  }
}

bool Drawing::free(const Box& box) const {
  for (int y = box.y0; y < box.y1; ++y) {
    for (int x = box.x0; x < box.x1; ++x) {
      if (!free(x, y)) return false;
    }
  }
  return true;
}

}  // namespace cairn::floors
