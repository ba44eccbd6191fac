// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "bounds.hpp"
#include "cairn/runtime/error.hpp"
#include "chart.hpp"
#include "ellipse.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

// How a graph in 3D is looked at.
constexpr double kAzimuth = 35 * std::numbers::pi / 180;
constexpr double kElevation = 28 * std::numbers::pi / 180;
// An initial guess that is further out than this many times the rest is cut off, not shrunk to.
constexpr double kGuessMayExceed = 2.5;
constexpr int kShades = 48;
// Side of the mark of a pose [px]; smaller where there are more poses than this.
constexpr double kMark = 3.4, kLeastMark = 1.2, kLargeMarks = 400;

/// Parallel projection, upwards being up.
const std::array<std::array<double, 3>, 2>& projection() {
  static const std::array<std::array<double, 3>, 2> P{
      {{std::cos(kAzimuth), std::sin(kAzimuth), 0},
       {-std::sin(kElevation) * std::sin(kAzimuth), std::sin(kElevation) * std::cos(kAzimuth),
        std::cos(kElevation)}}};
  return P;
}

/// A planar graph as it is.
std::vector<Point> project(const Scene& scene, const SceneEstimate& estimate) {
  std::vector<Point> points(scene.ids.size());
  for (std::size_t v = 0; v < points.size(); ++v) {
    if (scene.dimension == 2) {
      points[v] = {estimate.positions[2 * v], estimate.positions[2 * v + 1]};
      continue;
    }
    const double* p = &estimate.positions[3 * v];
    const auto row = [&](const std::array<double, 3>& r) {
      return r[0] * p[0] + r[1] * p[1] + r[2] * p[2];
    };
    points[v] = {row(projection()[0]), row(projection()[1])};
  }
  return points;
}

/// An estimate as it is drawn.
struct Layer {
  const SceneEstimate* estimate = nullptr;
  std::vector<Point> points;
  Stroke stroke;
};

/// What lies below first: the guess, then peers, the estimate, the truth, which is thin and dashed
/// and would be hidden by a good estimate.
std::vector<Layer> layers_of(const Scene& scene, const Theme& theme) {
  std::vector<Layer> layers;
  std::size_t peers = 0;
  // Thinner where many lines would run into one.
  const double width = std::clamp(std::sqrt(1000.0 / std::max(scene.edge_count(), 1)), 0.35, 1.0);
  for (const SceneEstimate& estimate : scene.estimates) {
    Layer layer{&estimate, project(scene, estimate), {}};
    switch (estimate.role) {
      case EstimateRole::initial:
        layer.stroke = theme.initial;
        break;
      case EstimateRole::estimate:
        layer.stroke = theme.estimate;
        break;
      case EstimateRole::truth:
        layer.stroke = theme.truth;
        break;
      case EstimateRole::peer:
        layer.stroke = theme.peer(peers++);
        break;
    }
    layer.stroke.width *= width;
    layers.push_back(std::move(layer));
  }
  const auto height = [](const Layer& layer) {
    constexpr std::array kHeights{0, 2, 3, 1};  // in the order of EstimateRole
    return kHeights[static_cast<std::size_t>(layer.estimate->role)];
  };
  std::stable_sort(layers.begin(), layers.end(),
                   [&](const Layer& a, const Layer& b) { return height(a) < height(b); });
  return layers;
}

/// The layer that has the edges, landmarks and poses: the uppermost but the truth, which has them
/// where there is nothing else.
const Layer& main_layer(const std::vector<Layer>& layers) {
  const auto shown = std::find_if(layers.rbegin(), layers.rend(), [](const Layer& layer) {
    return layer.estimate->role != EstimateRole::truth;
  });
  return shown == layers.rend() ? layers.back() : *shown;
}

Bounds bounds_of(const std::vector<Layer>& layers) {
  Bounds most, all;
  for (const Layer& layer : layers) {
    all.add(layer.points);
    if (layer.estimate->role != EstimateRole::initial) most.add(layer.points);
  }
  if (most.empty() || all.size() <= kGuessMayExceed * most.size()) return all;
  return most;
}

Stroke mark(const Theme& theme) { return {theme.residual(0.8), kMark, {}}; }
Stroke outline(const Theme& theme) { return {theme.muted, 0.7, {}}; }

bool is_line(EdgeClass edge_class) {
  return edge_class == EdgeClass::odometry || edge_class == EdgeClass::path;
}

class Drawing {
 public:
  Drawing(Canvas& canvas, const Theme& theme, const Scene& scene, const Box& area,
          const Bounds& bounds)
      : canvas_(canvas), theme_(theme), scene_(scene), area_(area), bounds_(bounds) {}

  void draw(const std::vector<Layer>& layers, const PlotOptions& options) {
    canvas_.clip(area_);
    const Layer& uppermost = main_layer(layers);
    for (const Layer& layer : layers) {
      const bool main = &layer == &uppermost;
      if (main && options.colour == EdgeColour::by_residual) {
        draw_residuals(layer);
      } else {
        if (main) draw_classes(layer);
        draw_path(layer);
      }
      if (main) draw_landmarks(layer);
      if (options.ellipses > 0) draw_ellipses(layer, options.ellipses);
      if (main && options.poses) draw_poses(layer);
    }
    canvas_.unclip();
  }

 private:
  double x(const Point& p) const {
    return area_.x + (p.x - bounds_.x0) / (bounds_.x1 - bounds_.x0) * area_.width;
  }
  double y(const Point& p) const {
    return area_.bottom() - (p.y - bounds_.y0) / (bounds_.y1 - bounds_.y0) * area_.height;
  }

  /// Adds the edge to the path; false if an end of it is not there.
  bool add(const Layer& layer, std::size_t e) {
    if (scene_.b[e] < 0) return false;
    const Point& a = layer.points[std::size_t(scene_.a[e])];
    const Point& b = layer.points[std::size_t(scene_.b[e])];
    if (!a.there() || !b.there()) return false;
    // Edges that go on where the last ended are one line, so that dashes go round corners.
    if (scene_.a[e] != last_) canvas_.move_to(x(a), y(a));
    canvas_.line_to(x(b), y(b));
    last_ = scene_.b[e];
    return true;
  }

  void draw_path(const Layer& layer) {
    last_ = -1;
    for (std::size_t e = 0; e < scene_.a.size(); ++e) {
      if (is_line(scene_.edge_class[e])) add(layer, e);
    }
    canvas_.stroke(layer.stroke);
  }

  void draw_classes(const Layer& layer) {
    for (const auto& [edge_class, stroke] : {std::pair{EdgeClass::landmark, theme_.landmark},
                                             {EdgeClass::other, theme_.landmark},
                                             {EdgeClass::loop, theme_.loop}}) {
      last_ = -1;
      for (std::size_t e = 0; e < scene_.a.size(); ++e) {
        if (scene_.edge_class[e] == edge_class) add(layer, e);
      }
      canvas_.stroke(stroke);
    }
  }

  void draw_landmarks(const Layer& layer) {
    for (std::size_t v = 0; v < layer.points.size(); ++v) {
      const Point& p = layer.points[v];
      if (!scene_.variable_types[scene_.variable_type[v]].pose && p.there()) {
        canvas_.dot(x(p), y(p), 1.5);
      }
    }
    canvas_.fill(
        Colour{theme_.landmark.colour.r, theme_.landmark.colour.g, theme_.landmark.colour.b, 1});
  }

  void draw_poses(const Layer& layer) {
    const double poses = std::max(kLargeMarks, double(layer.points.size()));
    const double side = std::max(kLeastMark, kMark * std::sqrt(kLargeMarks / poses));
    for (std::size_t v = 0; v < layer.points.size(); ++v) {
      const Point& p = layer.points[v];
      if (!scene_.variable_types[scene_.variable_type[v]].pose || !p.there()) continue;
      canvas_.rectangle({x(p) - side / 2, y(p) - side / 2, side, side});
    }
    canvas_.fill(mark(theme_).colour);
  }

  void draw_ellipses(const Layer& layer, double sigmas) {
    const SceneEstimate& estimate = *layer.estimate;
    const std::size_t numbers = scene_.dimension == 2 ? 3 : 6;
    for (std::size_t k = 0; k < estimate.covariance_variables.size(); ++k) {
      const Point& at = layer.points[std::size_t(estimate.covariance_variables[k])];
      const float* upper = &estimate.covariance_upper[numbers * k];
      const PlanarCovariance S = scene_.dimension == 2
                                     ? PlanarCovariance{upper[0], upper[1], upper[2]}
                                     : projected(projection(), upper);
      const auto corners = ellipse(S, sigmas);
      if (!at.there() || corners.empty()) continue;
      for (std::size_t c = 0; c <= corners.size(); ++c) {
        const auto& corner = corners[c % corners.size()];
        const Point p{at.x + corner[0], at.y + corner[1]};
        if (c == 0) canvas_.move_to(x(p), y(p));
        if (c > 0) canvas_.line_to(x(p), y(p));
      }
    }
    canvas_.stroke(outline(theme_));
  }

  /// From the least to the worst, which lies on top and is wider.
  void draw_residuals(const Layer& layer) {
    const std::vector<float>& chi2 = layer.estimate->edge_chi2;
    std::vector<double> logarithms;
    for (const float value : chi2) {
      if (value > 0) logarithms.push_back(std::log(double(value)));
    }
    if (logarithms.empty()) return draw_path(layer);
    std::sort(logarithms.begin(), logarithms.end());
    const double low = logarithms[logarithms.size() / 20];
    const double width = std::max(logarithms.back() - low, 1e-9);
    std::vector<std::vector<std::size_t>> shades(kShades);
    for (std::size_t e = 0; e < chi2.size(); ++e) {
      const double part = chi2[e] > 0 ? (std::log(double(chi2[e])) - low) / width : 0.0;
      const double shade = std::clamp(part, 0.0, 1.0) * (kShades - 1);
      shades[static_cast<std::size_t>(std::lround(shade))].push_back(e);
    }
    for (int s = 0; s < kShades; ++s) {
      const double part = double(s) / (kShades - 1);
      last_ = -1;
      for (const std::size_t e : shades[std::size_t(s)]) add(layer, e);
      canvas_.stroke({theme_.residual(part), 0.75 + 2.25 * part * part * part, {}});
    }
  }

  Canvas& canvas_;
  const Theme& theme_;
  const Scene& scene_;
  Box area_;
  Bounds bounds_;
  std::int32_t last_ = -1;
};

/// What stands for the length of a 3D graph, which has no axes to read it from.
void draw_scale(Canvas& canvas, const Theme& theme, const Box& area, const Bounds& bounds) {
  const double metres = bounds.x1 - bounds.x0;
  const double length = Range{0, metres / 4, false}.ticks(3).back();
  const double pixels = length / metres * area.width;
  const double y = area.bottom() - 8;
  canvas.line(area.x + 8, y, area.x + 8 + pixels, y, {theme.ink, 2, {}});
  canvas.text(area.x + 8, y - 6, tick_text(length) + " m", kTextSize, theme.ink);
}

std::vector<LegendEntry> legend_of(const Scene& scene, const Theme& theme,
                                   const std::vector<Layer>& layers, const PlotOptions& options) {
  const bool by_residual = options.colour == EdgeColour::by_residual;
  std::vector<LegendEntry> legend;
  for (auto layer = layers.rbegin(); layer != layers.rend(); ++layer) {
    if (by_residual && &*layer == &main_layer(layers)) {
      legend.push_back({"small residual", {theme.residual(0.1), 1, {}}});
      legend.push_back({"largest residual", {theme.residual(1), 3, {}}});
    } else {
      legend.push_back({layer->estimate->name, layer->stroke});
    }
  }
  const auto has = [&](EdgeClass edge_class) {
    return std::find(scene.edge_class.begin(), scene.edge_class.end(), edge_class) !=
           scene.edge_class.end();
  };
  if (!by_residual && has(EdgeClass::loop)) legend.push_back({"loop closure", theme.loop});
  if (!by_residual && has(EdgeClass::landmark)) legend.push_back({"landmark", theme.landmark});
  if (options.poses) legend.push_back({"pose", mark(theme)});
  if (options.ellipses > 0) {
    legend.push_back({fmt::format("covariance, {:.3g} σ", options.ellipses), outline(theme)});
  }
  return legend;
}

void draw_scene(Canvas& canvas, const Theme& theme, const Scene& scene, const Box& box,
                const PlotOptions& options) {
  const std::vector<Layer> layers = layers_of(scene, theme);
  if (options.ellipses > 0 && std::ranges::all_of(layers, [](const Layer& layer) {
        return layer.estimate->covariance_variables.empty();
      })) {
    throw Error(ErrorCode::input,
                scene.name +
                    ": there are no covariances to draw: give the report of cairn optimize GRAPH "
                    "--covariance blocks --json RUN.json -o OUT too, beside the GRAPH that it is "
                    "of: cairn plot GRAPH RUN.json --ellipses 3");
  }
  Bounds bounds = bounds_of(layers);
  if (bounds.empty())
    throw Error(ErrorCode::input, scene.name + ": none of its variables has a position");
  const Box rest =
      draw_heading(canvas, theme, box, scene.name, legend_of(scene, theme, layers, options));
  if (scene.dimension == 3) {
    equalise(bounds, rest);
    Drawing(canvas, theme, scene, rest, bounds).draw(layers, options);
    return draw_scale(canvas, theme, rest, bounds);
  }
  const Chart chart = plane(canvas, theme, rest, bounds);
  Drawing(canvas, theme, scene, chart.area(), bounds).draw(layers, options);
}

}  // namespace

void draw_trajectories(Canvas& canvas, const Theme& theme, const Album& album,
                       const PlotOptions& options) {
  std::vector<const Scene*> scenes;
  for (const Scene& scene : album.scenes) {
    if (!scene.estimates.empty() && scene.variable_count() > 0) scenes.push_back(&scene);
  }
  if (scenes.empty()) {
    throw Error(ErrorCode::input, "no graph to draw: give one, or a recording of a run");
  }
  const std::vector<Box> boxes = panels(canvas, scenes.size());
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    draw_scene(canvas, theme, *scenes[k], boxes[k], options);
  }
}

}  // namespace cairn::plot
