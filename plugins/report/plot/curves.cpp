// SPDX-License-Identifier: BSD-3-Clause
// Convergence, and time of each step.
#include <string>
#include <utility>
#include <vector>

#include "bench_data.hpp"
#include "cairn/runtime/error.hpp"
#include "chart.hpp"
#include "lines.hpp"
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
                "writes; of a CSV file columns are drawn");
  }
  return groups;
}

Line convergence(const Curve& curve, bool against_time) {
  Line points{curve.name, {}, {}};
  double time = 0;
  for (std::size_t i = 0; i < curve.chi2.size(); ++i) {
    if (i > 0) time += curve.seconds[i - 1];
    points.x.push_back(against_time ? time : static_cast<double>(i));
    points.y.push_back(curve.chi2[i]);
  }
  return points;
}

Line steps(const Curve& curve) {
  Line points{curve.name, {}, {}};
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
    std::vector<Line> lines;
    for (const Curve& curve : groups[g].curves) lines.push_back(convergence(curve, against_time));
    draw_lines(canvas, theme, boxes[g],
               {.title = groups[g].name + ": convergence",
                .x_label = against_time ? "time [s]" : kIteration,
                .y_label = "χ² (logarithmic)",
                .whole_x = !against_time},
               lines);
  }
}

void draw_steps(Canvas& canvas, const Theme& theme, const Album& album) {
  const std::vector<CurveGroup> groups = needed_curves(album);
  const std::vector<Box> boxes = panels(canvas, groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<Line> lines;
    for (const Curve& curve : groups[g].curves) lines.push_back(steps(curve));
    draw_lines(canvas, theme, boxes[g],
               {.title = groups[g].name + ": time of each step",
                .x_label = kIteration,
                .y_label = "time [ms] (logarithmic)",
                .whole_x = true},
               lines);
  }
}

}  // namespace cairn::plot
