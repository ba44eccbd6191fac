// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "axis.hpp"
#include "bounds.hpp"
#include "canvas.hpp"

namespace cairn::plot {

inline constexpr double kTitleSize = 14;
inline constexpr double kTextSize = 11;

/// A name, and how it is drawn.
struct LegendEntry {
  std::string name;
  Stroke stroke;
};

/// A title and below it a legend, in as many rows as it takes; returns what is left of the box.
Box draw_heading(Canvas& canvas, const Theme& theme, const Box& box, const std::string& title,
                 const std::vector<LegendEntry>& legend);

/// Axes with grid, ticks and labels within a box.
class Chart {
 public:
  Chart(Canvas& canvas, const Theme& theme, const Box& box, const Range& x, const Range& y,
        const std::string& x_label, const std::string& y_label);
  /// Where the data goes.
  const Box& area() const { return area_; }
  double x(double value) const { return area_.x + x_.part(value) * area_.width; }
  double y(double value) const { return area_.bottom() - y_.part(value) * area_.height; }

 private:
  Box area_;
  Range x_, y_;
};

/// Widens the bounds so that both axes of the box have the same number of pixels a metre, with some
/// room around.
void equalise(Bounds& bounds, const Box& box);

/// Axes in metres with the same scale, for bounds that are widened to fill the box.
Chart plane(Canvas& canvas, const Theme& theme, const Box& box, Bounds& bounds);

/// The boxes of `count` charts on a page, in rows of `columns`; 0: as square as can be.
std::vector<Box> panels(const Canvas& canvas, std::size_t count, std::size_t columns = 0);

}  // namespace cairn::plot
