// SPDX-License-Identifier: BSD-3-Clause
// Convergence, and time of each step.
#include <algorithm>
#include <cmath>

#include "bench_data.hpp"
#include "cairn/runtime/error.hpp"
#include "chart.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

constexpr const char* kIteration = "iteration";

/// One run: chi2 after iterations 0, 1, … and the seconds of iterations 1, 2, …
struct Curve {
  std::string name;
  std::vector<double> chi2, seconds;
};
struct CurveGroup {
  std::string name;
  std::vector<Curve> curves;
};

std::vector<CurveGroup> curves_of(const Album& album) {
  std::vector<CurveGroup> groups;
  if (!album.bench.empty()) {
    for (const BenchGraph& graph : read_bench(album.bench)) {
      CurveGroup group{graph.name, {}};
      for (const BenchConfiguration& c : graph.configurations) {
        if (c.chi2.empty()) continue;
        Curve curve{c.name, {c.initial_chi2}, c.seconds};
        curve.chi2.insert(curve.chi2.end(), c.chi2.begin(), c.chi2.end());
        group.curves.push_back(std::move(curve));
      }
      if (!group.curves.empty()) groups.push_back(std::move(group));
    }
    return groups;
  }
  for (const Scene& scene : album.scenes) {
    CurveGroup group{scene.name, {}};
    for (const SceneRun& run : scene.runs) {
      Curve curve{run.name, {run.summary.initial_chi2}, {}};
      for (const Iteration& it : run.summary.iterations) {
        curve.chi2.push_back(it.chi2);
        curve.seconds.push_back(it.seconds);
      }
      group.curves.push_back(std::move(curve));
    }
    if (!group.curves.empty()) groups.push_back(std::move(group));
  }
  return groups;
}

std::vector<CurveGroup> needed_curves(const Album& album) {
  std::vector<CurveGroup> groups = curves_of(album);
  if (groups.empty()) {
    throw Error(ErrorCode::input,
                "no run to draw: give a recording, or the JSON that cairn optimize or cairn bench "
                "writes");
  }
  return groups;
}

Stroke stroke_of(const Theme& theme, std::size_t curve) {
  return curve == 0 ? theme.estimate : theme.peer(curve - 1);
}

std::vector<LegendEntry> legend_of(const Theme& theme, const CurveGroup& group) {
  std::vector<LegendEntry> legend;
  for (std::size_t k = 0; k < group.curves.size(); ++k) {
    legend.push_back({group.curves[k].name, stroke_of(theme, k)});
  }
  return legend;
}

struct Points {
  std::vector<double> x, y;
};

void draw_lines(Canvas& canvas, const Theme& theme, const Box& box, const CurveGroup& group,
                const std::vector<Points>& lines, const std::string& title,
                const std::string& x_label, const std::string& y_label) {
  std::vector<double> xs, ys;
  for (const Points& line : lines) {
    xs.insert(xs.end(), line.x.begin(), line.x.end());
    ys.insert(ys.end(), line.y.begin(), line.y.end());
  }
  const Box rest = draw_heading(canvas, theme, box, title, legend_of(theme, group));
  Range x = range_of(xs, false);
  x.whole = x_label == kIteration;
  const Chart chart(canvas, theme, rest, x, range_of(ys, true), x_label, y_label);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Points& line = lines[k];
    bool open = false;
    for (std::size_t i = 0; i < line.x.size(); ++i) {
      // What a logarithm does not have is a gap.
      const bool shown = line.y[i] > 0 && std::isfinite(line.y[i]) && std::isfinite(line.x[i]);
      if (shown && open) canvas.line_to(chart.x(line.x[i]), chart.y(line.y[i]));
      if (shown && !open) canvas.move_to(chart.x(line.x[i]), chart.y(line.y[i]));
      open = shown;
    }
    canvas.stroke(stroke_of(theme, k));
    for (std::size_t i = 0; i < line.x.size(); ++i) {
      if (line.y[i] > 0 && std::isfinite(line.y[i]) && std::isfinite(line.x[i])) {
        canvas.dot(chart.x(line.x[i]), chart.y(line.y[i]), 2);
      }
    }
    canvas.fill(stroke_of(theme, k).colour);
  }
}

Points convergence(const Curve& curve, bool against_time) {
  Points points;
  double time = 0;
  for (std::size_t i = 0; i < curve.chi2.size(); ++i) {
    if (i > 0) time += curve.seconds[i - 1];
    points.x.push_back(against_time ? time : static_cast<double>(i));
    points.y.push_back(curve.chi2[i]);
  }
  return points;
}

Points steps(const Curve& curve) {
  Points points;
  for (std::size_t i = 0; i < curve.seconds.size(); ++i) {
    points.x.push_back(static_cast<double>(i + 1));
    points.y.push_back(1e3 * curve.seconds[i]);
  }
  return points;
}

}  // namespace

void draw_convergence(Canvas& canvas, const Theme& theme, const Album& album, bool against_time) {
  const std::vector<CurveGroup> groups = needed_curves(album);
  const std::vector<Box> boxes = panels(canvas, groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<Points> lines;
    for (const Curve& curve : groups[g].curves) lines.push_back(convergence(curve, against_time));
    draw_lines(canvas, theme, boxes[g], groups[g], lines, groups[g].name + ": convergence",
               against_time ? "time [s]" : kIteration, "χ² (logarithmic)");
  }
}

void draw_steps(Canvas& canvas, const Theme& theme, const Album& album) {
  const std::vector<CurveGroup> groups = needed_curves(album);
  const std::vector<Box> boxes = panels(canvas, groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<Points> lines;
    for (const Curve& curve : groups[g].curves) lines.push_back(steps(curve));
    draw_lines(canvas, theme, boxes[g], groups[g], lines, groups[g].name + ": time of each step",
               kIteration, "time [ms] (logarithmic)");
  }
}

}  // namespace cairn::plot
