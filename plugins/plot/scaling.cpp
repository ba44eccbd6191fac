// SPDX-License-Identifier: BSD-3-Clause
// Time and memory against size.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "bench_data.hpp"
#include "cairn/runtime/error.hpp"
#include "chart.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

constexpr double kMebibyte = 1024.0 * 1024.0;

/// One solver over all graphs that it ran on.
struct Line {
  std::string name;
  std::vector<std::pair<double, double>> seconds, mebibytes;  ///< against the number of variables
};

std::vector<Line> lines_of(const std::vector<BenchGraph>& graphs) {
  std::vector<Line> lines;
  for (const BenchGraph& graph : graphs) {
    for (const BenchConfiguration& c : graph.configurations) {
      if (!c.ran) continue;
      auto line = std::find_if(lines.begin(), lines.end(),
                               [&](const Line& known) { return known.name == c.name; });
      if (line == lines.end()) line = lines.insert(line, Line{c.name, {}, {}});
      line->seconds.emplace_back(graph.variables, c.median);
      if (c.memory > 0) line->mebibytes.emplace_back(graph.variables, c.memory / kMebibyte);
    }
  }
  for (Line& line : lines) {
    std::sort(line.seconds.begin(), line.seconds.end());
    std::sort(line.mebibytes.begin(), line.mebibytes.end());
  }
  return lines;
}

Stroke stroke_of(const Theme& theme, std::size_t line) {
  return line == 0 ? theme.estimate : theme.peer(line - 1);
}

void draw_panel(Canvas& canvas, const Theme& theme, const Box& box, const std::vector<Line>& lines,
                std::vector<std::pair<double, double>> Line::*points, const std::string& title,
                const std::string& label) {
  std::vector<double> xs, ys;
  std::vector<LegendEntry> legend;
  for (const Line& line : lines) {
    legend.push_back({line.name, stroke_of(theme, legend.size())});
    for (const auto& [x, y] : line.*points) {
      xs.push_back(x);
      ys.push_back(y);
    }
  }
  const Box rest = draw_heading(canvas, theme, box, title, legend);
  const Chart chart(canvas, theme, rest, range_of(xs, true), range_of(ys, true), "variables",
                    label);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const auto& all = lines[k].*points;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const double x = chart.x(all[i].first), y = chart.y(all[i].second);
      if (i == 0) canvas.move_to(x, y);
      if (i > 0) canvas.line_to(x, y);
    }
    canvas.stroke(stroke_of(theme, k));
    for (const auto& [x, y] : all) canvas.dot(chart.x(x), chart.y(y), 2.5);
    canvas.fill(stroke_of(theme, k).colour);
  }
}

}  // namespace

void draw_scaling(Canvas& canvas, const Theme& theme, const Album& album) {
  if (album.bench.empty()) {
    throw Error(ErrorCode::input, "no comparison to draw: give the JSON that cairn bench writes");
  }
  const std::vector<Line> lines = lines_of(read_bench(album.bench));
  const std::vector<Box> boxes = panels(canvas, 2, 2);
  draw_panel(canvas, theme, boxes[0], lines, &Line::seconds, "Time of optimisation", "time [s]");
  draw_panel(canvas, theme, boxes[1], lines, &Line::mebibytes, "Peak memory", "peak memory [MiB]");
}

}  // namespace cairn::plot
