// SPDX-License-Identifier: BSD-3-Clause
#include "lines.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "axis.hpp"
#include "chart.hpp"

namespace cairn::plot {
namespace {

/// More points than these are a line without dots.
constexpr std::size_t kDots = 100;

Stroke stroke_of(const Theme& theme, std::size_t line) {
  return line == 0 ? theme.estimate : theme.peer(line - 1);
}

bool can_be_shown(double value, bool logarithmic) {
  return std::isfinite(value) && (value > 0 || !logarithmic);
}

bool can_be_shown(const LineChart& chart, const Line& line, std::size_t i) {
  return can_be_shown(line.x[i], chart.logarithmic_x) &&
         can_be_shown(line.y[i], chart.logarithmic_y);
}

Range range_of_all(const std::vector<Line>& lines, std::vector<double> Line::*numbers,
                   bool logarithmic) {
  std::vector<double> all;
  for (const Line& line : lines)
    all.insert(all.end(), (line.*numbers).begin(), (line.*numbers).end());
  return range_of(all, logarithmic);
}

}  // namespace

bool can_be_drawn(const LineChart& chart, const Line& line) {
  for (std::size_t i = 0; i < line.x.size(); ++i) {
    if (can_be_shown(chart, line, i)) return true;
  }
  return false;
}

void draw_lines(Canvas& canvas, const Theme& theme, const Box& box, const LineChart& chart,
                const std::vector<Line>& lines) {
  std::vector<LegendEntry> legend;
  for (const Line& line : lines) legend.push_back({line.name, stroke_of(theme, legend.size())});
  const Box rest = draw_heading(canvas, theme, box, chart.title, legend);
  Range x = range_of_all(lines, &Line::x, chart.logarithmic_x);
  x.whole = chart.whole_x;
  const Chart axes(canvas, theme, rest, x, range_of_all(lines, &Line::y, chart.logarithmic_y),
                   chart.x_label, chart.y_label);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Line& line = lines[k];
    const auto shown = [&](std::size_t i) { return can_be_shown(chart, line, i); };
    bool open = false;
    for (std::size_t i = 0; i < line.x.size(); ++i) {
      if (shown(i) && open) canvas.line_to(axes.x(line.x[i]), axes.y(line.y[i]));
      if (shown(i) && !open) canvas.move_to(axes.x(line.x[i]), axes.y(line.y[i]));
      open = shown(i);
    }
    canvas.stroke(stroke_of(theme, k));
    if (line.x.size() > kDots) continue;
    for (std::size_t i = 0; i < line.x.size(); ++i) {
      if (shown(i)) canvas.dot(axes.x(line.x[i]), axes.y(line.y[i]), 2);
    }
    canvas.fill(stroke_of(theme, k).colour);
  }
}

}  // namespace cairn::plot
