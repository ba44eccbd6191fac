// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include <fmt/core.h>

#include "bench_data.hpp"
#include "chart.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

constexpr double kWhisker = 3;

std::string time_text(double seconds) {
  return seconds < 1 ? fmt::format("{:.3g} ms", 1e3 * seconds) : fmt::format("{:.3g} s", seconds);
}

/// One row a configuration: its name, a bar as long as its median, a whisker from fastest to
/// slowest, the number.
void draw_graph(Canvas& canvas, const Theme& theme, const Box& box, const BenchGraph& graph) {
  Box rest = draw_heading(canvas, theme, box, graph.name, {});
  double names = 0, longest = 0, numbers = 0;
  for (const BenchConfiguration& c : graph.configurations) {
    names = std::max(names, canvas.text_width(c.name, kTextSize));
    if (!c.ran) continue;
    longest = std::max(longest, c.high);
    numbers = std::max(numbers, canvas.text_width(time_text(c.median), kTextSize));
  }
  names = std::min(names, box.width * 0.45);
  const double left = rest.x + names + 10;
  const double scale = (rest.right() - left - numbers - 12) / std::max(longest, 1e-12);
  rest.height -= 2 * kTextSize;
  const double row = std::min(rest.height / static_cast<double>(graph.configurations.size()), 36.0);
  for (std::size_t k = 0; k < graph.configurations.size(); ++k) {
    const BenchConfiguration& c = graph.configurations[k];
    const double middle = rest.y + (static_cast<double>(k) + 0.5) * row;
    canvas.text(left - 8, middle + 4, c.name, kTextSize, theme.ink, Align::right, false, names);
    if (!c.ran) {
      canvas.text(left + 4, middle + 4, "did not run", kTextSize, theme.muted);
      continue;
    }
    canvas.rectangle({left, middle - 0.32 * row, scale * c.median, 0.64 * row});
    canvas.fill(k == 0 ? theme.estimate.colour : theme.peer(k - 1).colour);
    const Stroke ink{theme.ink, 1, {}};
    canvas.line(left + scale * c.low, middle, left + scale * c.high, middle, ink);
    for (const double end : {c.low, c.high}) {
      canvas.line(left + scale * end, middle - kWhisker, left + scale * end, middle + kWhisker,
                  ink);
    }
    canvas.text(left + scale * std::max(c.high, c.median) + 8, middle + 4, time_text(c.median),
                kTextSize, theme.ink);
  }
  const double bottom = rest.y + row * static_cast<double>(graph.configurations.size());
  canvas.line(left, rest.y, left, bottom, {theme.muted, 1, {}});
  canvas.text(left, bottom + kTextSize + 6, "time of optimisation: median, fastest to slowest",
              kTextSize, theme.muted, Align::left, false, rest.right() - left);
}

}  // namespace

void draw_bars(Canvas& canvas, const Theme& theme, const Album& album) {
  const std::vector<BenchGraph> graphs = read_bench(album.bench);
  const std::vector<Box> boxes = panels(canvas, graphs.size(), 1);
  for (std::size_t g = 0; g < graphs.size(); ++g) draw_graph(canvas, theme, boxes[g], graphs[g]);
}

}  // namespace cairn::plot
