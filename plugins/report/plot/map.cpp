// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "bounds.hpp"
#include "cairn/runtime/error.hpp"
#include "chart.hpp"
#include "ellipse.hpp"
#include "exploration_data.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

constexpr double kSigmas = 3.0;  // of the ellipse, if the options don't say
constexpr int kShades = 24;
constexpr double kScanDot = 1.0;  // [px]

Stroke trajectory_stroke(const Theme& theme) { return {theme.estimate.colour, 1.2, {}}; }
Stroke path_stroke(const Theme& theme) { return {theme.peer(2).colour, 3, {}}; }
Stroke scan_stroke(const Theme& theme) { return {theme.peer(1).colour, 2.0, {}}; }
Stroke robot_stroke(const Theme& theme) { return {theme.estimate.colour, 1.5, {}}; }

Colour cell_colour(const Theme& theme, std::uint8_t cell) {
  if (cell == RecordedMap::kUnknown) return theme.grid;
  return mix(theme.paper, theme.ink, std::min(cell / 100.0, 1.0));
}

/// A place of the map, in cells.
Point place(const GridFrame& frame, int x, int y) {
  const Eigen::Vector2d world = frame.to_world({x, y});
  return {world.x(), world.y()};
}

/// Where the known cells are, and the robot.
Bounds bounds_of(const RecordedState& state) {
  const GridFrame& frame = state.map.frame;
  int left = frame.width, right = -1, bottom = frame.height, top = -1;
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      if (state.map.cells[frame.index(x, y)] == RecordedMap::kUnknown) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      bottom = std::min(bottom, y);
      top = std::max(top, y);
    }
  }
  Bounds bounds;
  bounds.add(state.robot);
  if (right < 0) return bounds;
  for (const int x : {left, right + 1})
    for (const int y : {bottom, top + 1}) bounds.add(place(frame, x, y));
  return bounds;
}

/// How good a value is, from 0 (the worst drawn as such) to 1 (the least, which is best). Where
/// there are values below zero, which are gains, zero and more is worst.
class Goodness {
 public:
  explicit Goodness(const std::vector<double>& values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      best_ = std::min(best_, value);
      worst_ = std::max(worst_, value);
    }
    if (best_ < 0.0) worst_ = std::min(worst_, 0.0);
  }
  bool empty() const { return best_ > worst_; }
  bool differs() const { return worst_ > best_; }
  double best() const { return best_; }
  double worst() const { return worst_; }
  double of(double value) const {
    if (!std::isfinite(value)) return 0.0;
    if (!differs()) return 1.0;
    return std::clamp((worst_ - value) / (worst_ - best_), 0.0, 1.0);
  }

 private:
  double best_ = std::numeric_limits<double>::infinity(), worst_ = -best_;
};

std::vector<double> values_of(const RecordedDecision& decision) {
  std::vector<double> values = decision.values;
  if (!decision.nodes.empty()) return values;
  for (const auto& candidate : decision.candidates) values.push_back(candidate.value);
  return values;
}

class MapDrawing {
 public:
  MapDrawing(Canvas& canvas, const Theme& theme, const RecordedState& state, const Chart& chart)
      : canvas_(canvas), theme_(theme), state_(state), chart_(chart) {}

  void draw(double sigmas) {
    canvas_.clip(chart_.area());
    draw_cells();
    draw_scan();
    if (state_.decision) draw_choices(*state_.decision);
    draw_edges(EdgeClass::loop, theme_.loop);
    draw_edges(EdgeClass::odometry, trajectory_stroke(theme_));
    if (state_.decision) draw_chosen(*state_.decision);
    draw_robot(sigmas);
    canvas_.unclip();
  }

 private:
  double x(const Point& p) const { return chart_.x(p.x); }
  double y(const Point& p) const { return chart_.y(p.y); }

  void draw_cells() {
    const RecordedMap& map = state_.map;
    canvas_.rectangle(chart_.area());
    canvas_.fill(cell_colour(theme_, RecordedMap::kUnknown));
    const auto corner = [&](int column, int row) {
      const Point p = place(map.frame, column, row);
      return std::array{x(p), y(p)};
    };
    std::array<Colour, 256> colours;
    for (std::size_t k = 0; k < colours.size(); ++k)
      colours[k] = cell_colour(theme_, static_cast<std::uint8_t>(k));
    canvas_.image([&](std::size_t k) { return colours[map.cells[k]]; }, map.frame.width,
                  map.frame.height, corner(0, 0), corner(1, 0), corner(0, 1));
  }

  void draw_scan() {
    for (const Point& end : state_.scan) canvas_.dot(x(end), y(end), kScanDot);
    canvas_.fill(scan_stroke(theme_).colour);
  }

  void draw_edges(EdgeClass kind, const Stroke& stroke) {
    for (const auto& [number, edge] : state_.edges) {
      const auto a = state_.poses.find(edge.a), b = state_.poses.find(edge.b);
      if (edge.kind != kind || a == state_.poses.end() || b == state_.poses.end()) continue;
      canvas_.move_to(x(a->second), y(a->second));
      canvas_.line_to(x(b->second), y(b->second));
    }
    canvas_.stroke(stroke);
  }

  /// A tree, or the candidates, coloured by their values: the best lie on top.
  void draw_choices(const RecordedDecision& decision) {
    const Goodness goodness(values_of(decision));
    const auto shade = [&](double value) {
      return static_cast<int>(std::lround(goodness.of(value) * (kShades - 1)));
    };
    for (int k = 0; k < kShades; ++k) {
      for (std::size_t node = 0; node < decision.nodes.size(); ++node) {
        const int parent = decision.parents[node];
        if (parent < 0 || shade(decision.values[node]) != k) continue;
        draw_line({decision.nodes[static_cast<std::size_t>(parent)], decision.nodes[node]});
      }
      if (decision.nodes.empty()) {
        for (const auto& candidate : decision.candidates)
          if (shade(candidate.value) == k) draw_line(candidate.points);
      }
      const double part = double(k) / (kShades - 1);
      canvas_.stroke({theme_.residual(part), 0.75 + part, {}});
    }
  }

  void draw_chosen(const RecordedDecision& decision) {
    if (decision.chosen < 0) return;
    draw_line(decision.candidates[static_cast<std::size_t>(decision.chosen)].points);
    canvas_.stroke(path_stroke(theme_));
  }

  void draw_line(const std::vector<Point>& points) {
    bool is_first = true;
    for (const Point& p : points) {
      if (!p.there()) continue;
      if (std::exchange(is_first, false))
        canvas_.move_to(x(p), y(p));
      else
        canvas_.line_to(x(p), y(p));
    }
  }

  void draw_robot(double sigmas) {
    const Point& at = state_.robot;
    if (!at.there()) return;
    const double radius = state_.radius > 0.0 ? x({at.x + state_.radius, at.y}) - x(at) : 0.0;
    constexpr double kLeast = 2.0, kMost = 1000.0;  // [px]
    canvas_.dot(x(at), y(at), std::clamp(radius, kLeast, kMost));
    std::vector<Point> corners;
    for (const auto& [dx, dy] : ellipse(state_.covariance, sigmas))
      corners.push_back({at.x + dx, at.y + dy});
    if (!corners.empty()) corners.push_back(corners.front());
    draw_line(corners);
    canvas_.stroke(robot_stroke(theme_));
  }

  Canvas& canvas_;
  const Theme& theme_;
  const RecordedState& state_;
  const Chart& chart_;
};

std::vector<LegendEntry> legend_of(const RecordedState& state, const Theme& theme, double sigmas) {
  std::vector<LegendEntry> legend{{"trajectory", trajectory_stroke(theme)}};
  if (std::ranges::any_of(state.edges,
                          [](const auto& edge) { return edge.second.kind == EdgeClass::loop; }))
    legend.push_back({"loop closure", theme.loop});
  if (!state.scan.empty()) legend.push_back({"scan", scan_stroke(theme)});
  legend.push_back({fmt::format("robot, {:.3g} σ", sigmas), robot_stroke(theme)});
  if (!state.decision) return legend;
  const Goodness goodness(values_of(*state.decision));
  const char* const what = state.decision->nodes.empty() ? "candidate" : "path";
  if (!goodness.empty()) {
    legend.push_back(
        {fmt::format("{} of {:.3g}", what, goodness.best()), {theme.residual(1), 2, {}}});
    if (goodness.differs())
      legend.push_back({fmt::format("of {:.3g}", goodness.worst()), {theme.residual(0), 1, {}}});
  }
  if (state.decision->chosen >= 0) legend.push_back({"chosen", path_stroke(theme)});
  return legend;
}

}  // namespace

void draw_maps(Canvas& canvas, const Theme& theme, const Album& album, const PlotOptions& options) {
  if (album.explorations.empty()) {
    throw Error(ErrorCode::input,
                "no map to draw: give the recording of an exploration, as cairn explore --record "
                "RUN.jsonl writes it");
  }
  const double sigmas = options.ellipses > 0.0 ? options.ellipses : kSigmas;
  const std::optional<int> decision =
      options.decision > 0 ? std::optional(options.decision) : std::nullopt;
  const std::vector<Box> boxes = panels(canvas, album.explorations.size());
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    const RecordedState state = recorded_state(album.explorations[k], decision);
    Bounds bounds = bounds_of(state);
    if (bounds.empty()) throw Error(ErrorCode::input, state.name + ": nothing on its map is known");
    const Box rest =
        draw_heading(canvas, theme, boxes[k], state.name, legend_of(state, theme, sigmas));
    const Chart chart = plane(canvas, theme, rest, bounds);
    MapDrawing(canvas, theme, state, chart).draw(sigmas);
  }
}

}  // namespace cairn::plot
