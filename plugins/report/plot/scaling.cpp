// SPDX-License-Identifier: BSD-3-Clause
// Time and memory against size.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "bench_data.hpp"
#include "chart.hpp"
#include "lines.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

constexpr double kMebibyte = 1024.0 * 1024.0;

/// One solver over all graphs that it ran on.
struct Solver {
  std::string name;
  std::vector<std::pair<double, double>> seconds, mebibytes;  ///< against the number of variables
};

std::vector<Solver> solvers_of(const std::vector<BenchGraph>& graphs) {
  std::vector<Solver> lines;
  for (const BenchGraph& graph : graphs) {
    for (const BenchConfiguration& c : graph.configurations) {
      if (!c.ran) continue;
      auto line = std::find_if(lines.begin(), lines.end(),
                               [&](const Solver& known) { return known.name == c.name; });
      if (line == lines.end()) line = lines.insert(line, Solver{c.name, {}, {}});
      line->seconds.emplace_back(graph.variables, c.median);
      if (c.memory > 0) line->mebibytes.emplace_back(graph.variables, c.memory / kMebibyte);
    }
  }
  for (Solver& line : lines) {
    std::sort(line.seconds.begin(), line.seconds.end());
    std::sort(line.mebibytes.begin(), line.mebibytes.end());
  }
  return lines;
}

void draw_panel(Canvas& canvas, const Theme& theme, const Box& box,
                const std::vector<Solver>& solvers,
                std::vector<std::pair<double, double>> Solver::*points, const std::string& title,
                const std::string& label) {
  std::vector<Line> lines;
  for (const Solver& solver : solvers) {
    Line& line = lines.emplace_back(Line{solver.name, {}, {}});
    for (const auto& [x, y] : solver.*points) {
      line.x.push_back(x);
      line.y.push_back(y);
    }
  }
  draw_lines(canvas, theme, box,
             {.title = title, .x_label = "variables", .y_label = label, .logarithmic_x = true},
             lines);
}

}  // namespace

void draw_scaling(Canvas& canvas, const Theme& theme, const Album& album) {
  const std::vector<Solver> solvers = solvers_of(read_bench(album.bench));
  // Memory is not measured with --no-memory.
  const bool with_memory =
      std::ranges::any_of(solvers, [](const Solver& s) { return !s.mebibytes.empty(); });
  const std::size_t count = with_memory ? 2 : 1;
  const std::vector<Box> boxes = panels(canvas, count, count);
  draw_panel(canvas, theme, boxes[0], solvers, &Solver::seconds, "Time of optimisation",
             "time [s]");
  if (!with_memory) return;
  draw_panel(canvas, theme, boxes[1], solvers, &Solver::mebibytes, "Peak memory",
             "peak memory [MiB]");
}

}  // namespace cairn::plot
