// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "canvas.hpp"

namespace cairn::plot {

/// A curve, with its name in the legend.
struct Line {
  std::string name;
  std::vector<double> x, y;  ///< as many of each; NaN: a gap
};

/// What a chart of lines says, and its axes.
struct LineChart {
  std::string title, x_label, y_label;
  bool logarithmic_x = false, logarithmic_y = true;
  bool whole_x = false;  ///< only integers have a meaning on the horizontal axis
};

/// Whether the axes can show any point of the line.
bool can_be_drawn(const LineChart& chart, const Line& line);

/// Draws lines on axes that hold them all, with a dot at each point unless there are many. What an
/// axis cannot show, such as zero on a logarithmic one, is a gap.
void draw_lines(Canvas& canvas, const Theme& theme, const Box& box, const LineChart& chart,
                const std::vector<Line>& lines);

}  // namespace cairn::plot
