// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bounds.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/report/scene.hpp"
#include "ellipse.hpp"

namespace cairn::plot {

/// The map of a robot: a box that holds all that it knows.
struct RecordedMap {
  static constexpr std::uint8_t kUnknown = 255, kUnchanged = 254;

  GridFrame frame;
  std::vector<std::uint8_t> cells;  ///< by `GridFrame::index`: per cent occupied, or `kUnknown`
};

/// What was decided between.
struct RecordedDecision {
  struct Path {
    double value = std::numeric_limits<double>::quiet_NaN();
    std::vector<Point> points;
  };
  std::vector<Path> candidates;
  int chosen = -1;  ///< −1: none
  // A tree of paths: none, or as many of each.
  std::vector<Point> nodes;
  std::vector<int> parents;  ///< −1: the root
  std::vector<double> values;
};

/// What a recorded robot knew at some time.
struct RecordedState {
  struct Edge {
    std::int64_t a = 0, b = 0;
    EdgeClass kind = EdgeClass::other;
  };

  std::string name;
  double radius = 0.0;  ///< of its body [m]
  RecordedMap map;
  std::map<std::int64_t, Point> poses;  ///< of the graph, by id
  std::map<std::int64_t, Edge> edges;   ///< by the factor's number
  Point robot;
  PlanarCovariance covariance;               ///< of the newest pose [m²]; zero: not known
  std::vector<Point> scan;                   ///< where the beams of its newest scan ended [m]
  std::optional<RecordedDecision> decision;  ///< that was asked for
};

/// Replays an EXPLORATION of docs/report.md up to the decision of that number, or to its end.
/// Throws `Error` (input) if there is no such decision, or no map.
RecordedState recorded_state(std::string_view exploration, std::optional<int> decision);

}  // namespace cairn::plot
