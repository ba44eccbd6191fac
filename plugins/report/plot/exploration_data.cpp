// SPDX-License-Identifier: BSD-3-Clause
#include "exploration_data.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>

#include "cairn/io/packed_array.hpp"
#include "cairn/runtime/error.hpp"
#include "json_members.hpp"

namespace cairn::plot {
namespace {

namespace json = boost::json;

constexpr double kMostCells = 1e8;
constexpr double kMostNumbers = 1e8;
constexpr double kFarthest = 1e9;  // [m]
constexpr double kMissing = 65535.0, kSteps = 65534.0;

/// −1 for what is none.
std::int64_t integer(const json::value& value) {
  const double found = number(value);
  return std::abs(found) < 9e15 ? static_cast<std::int64_t>(found) : -1;
}

bool is_integer(double number, double least, double most) {
  return number == std::floor(number) && number >= least && number <= most;
}

Point point(const json::array& numbers) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (numbers.size() < 2) return {kNone, kNone};
  return {number(numbers[0]), number(numbers[1])};
}

/// An array of docs/report.md; of 16-bit steps the coordinates that they stand for.
std::vector<double> unpacked(const json::value& array, const std::string& where) {
  const double count = number(array, "count");
  if (!(count >= 0.0 && count <= kMostNumbers)) return {};
  const std::string deflated = text(array, "deflate"), type = text(array, "type");
  std::vector<double> numbers =
      unpack_numbers(type, deflated.empty() ? text(array, "base64") : deflated,
                     deflated.empty() ? Packing::base64 : Packing::deflate,
                     static_cast<std::size_t>(count), where);
  const json::array &low = list(array, "min"), &high = list(array, "max");
  if (type != "u16" || low.empty() || low.size() != high.size()) return numbers;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const double least = number(low[k % low.size()]), most = number(high[k % low.size()]);
    numbers[k] = numbers[k] == kMissing ? std::numeric_limits<double>::quiet_NaN()
                                        : least + numbers[k] / kSteps * (most - least);
  }
  return numbers;
}

class Replay {
 public:
  Replay(std::string name, double radius) {
    state_.name = std::move(name);
    state_.radius = radius;
  }

  void take(const json::value& line) {
    if (const json::value* map = member(line, "map")) take_map(*map);
    for (const json::value& pose : list(line, "poses")) {
      const json::array& numbers = list(pose);
      if (numbers.size() >= 3)
        state_.poses[integer(numbers[0])] = {number(numbers[1]), number(numbers[2])};
    }
    for (const json::value& id : list(line, "removed_poses")) state_.poses.erase(integer(id));
    for (const json::value& edge : list(line, "edges")) {
      const json::array& numbers = list(edge);
      if (numbers.size() >= 4) {
        state_.edges[integer(numbers[0])] = {integer(numbers[1]), integer(numbers[2]),
                                             static_cast<EdgeClass>(integer(numbers[3]))};
      }
    }
    for (const json::value& id : list(line, "removed_edges")) state_.edges.erase(integer(id));
    if (const json::value* scan = member(line, "scan")) scan_ = scan;
    if (const json::array& pose = list(line, "estimate"); pose.size() >= 3) {
      const Point at = point(pose);
      if (std::max(std::abs(at.x), std::abs(at.y)) <= kFarthest) state_.robot = at;
      heading_ = number(pose[2]);
    }
    if (member(line, "covariance")) {
      const json::array& upper = list(line, "covariance");
      state_.covariance = {};
      if (upper.size() >= 3)
        state_.covariance = {number(upper[0]), number(upper[1]), number(upper[2])};
    }
  }

  void decide(const json::value& line) {
    RecordedDecision decision;
    for (const json::value& candidate : list(line, "candidates")) {
      RecordedDecision::Path path{number(candidate, "value"), {}};
      for (const json::value& corner : list(candidate, "points"))
        path.points.push_back(point(list(corner)));
      decision.candidates.push_back(std::move(path));
    }
    const double chosen = number(line, "chosen");
    if (chosen >= 0.0 && chosen < static_cast<double>(decision.candidates.size()))
      decision.chosen = static_cast<int>(chosen);
    if (const json::value* tree = member(line, "tree")) take_tree(*tree, decision);
    state_.decision = std::move(decision);
  }

  RecordedState finish() && {
    if (state_.map.cells.empty())
      throw Error(ErrorCode::input, state_.name + ": the recording has no map to draw");
    if (scan_) take_scan();
    return std::move(state_);
  }

 private:
  void begin_map(const json::value& map) {
    const Point origin = point(list(map, "origin"));
    first_x_ = first_y_ = 0;
    state_.map = {};
    state_.map.frame = {.width = 1,
                        .height = 1,
                        .resolution = number(map, "resolution"),
                        .origin = {origin.x, origin.y},
                        .yaw = member(map, "yaw") ? number(map, "yaw") : 0.0};
    check_frame(state_.map.frame, state_.name);
    state_.map.frame.width = state_.map.frame.height = 0;
  }

  void take_map(const json::value& map) {
    if (member(map, "resolution")) begin_map(map);
    const double x = number(map, "x"), y = number(map, "y"), width = number(map, "width"),
                 height = number(map, "height");
    const bool is_box = is_integer(x, -kMostCells, kMostCells) &&
                        is_integer(y, -kMostCells, kMostCells) &&
                        is_integer(width, 1.0, kMostCells) && is_integer(height, 1.0, kMostCells) &&
                        width * height <= kMostCells;
    const json::value* packed = member(map, "cells");
    if (!is_box || !packed || !(state_.map.frame.resolution > 0.0)) return;
    const int left = static_cast<int>(x), bottom = static_cast<int>(y),
              columns = static_cast<int>(width), rows = static_cast<int>(height);
    const std::vector<double> cells = unpacked(*packed, state_.name + ", cells");
    if (cells.size() != static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows)) return;
    cover(left, bottom, left + columns, bottom + rows);
    auto next = cells.begin();
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const double cell = *next++;
        if (cell == RecordedMap::kUnchanged) continue;
        state_.map.cells[index(left + column, bottom + row)] =
            cell >= 0.0 && cell <= 100.0 ? static_cast<std::uint8_t>(cell) : RecordedMap::kUnknown;
      }
    }
  }

  /// Of a cell, counted from the origin.
  std::size_t index(int x, int y) const {
    return state_.map.frame.index(x - first_x_, y - first_y_);
  }

  /// Makes the box of the map hold this one, ends excluded.
  void cover(int left, int bottom, int right, int top) {
    RecordedMap& map = state_.map;
    if (!map.cells.empty()) {
      left = std::min(left, first_x_);
      bottom = std::min(bottom, first_y_);
      right = std::max(right, first_x_ + map.frame.width);
      top = std::max(top, first_y_ + map.frame.height);
      if (right - left == map.frame.width && top - bottom == map.frame.height) return;
    }
    const RecordedMap before = std::exchange(map, {});
    const int shift_x = first_x_ - left, shift_y = first_y_ - bottom;
    first_x_ = left;
    first_y_ = bottom;
    map.frame = before.frame;
    map.frame.width = right - left;
    map.frame.height = top - bottom;
    map.frame.origin = before.frame.to_world({-shift_x, -shift_y});
    check_frame(map.frame, state_.name);
    map.cells.assign(static_cast<std::size_t>(map.frame.size()), RecordedMap::kUnknown);
    for (int y = 0; y < before.frame.height; ++y) {
      std::copy_n(
          before.cells.begin() + static_cast<std::ptrdiff_t>(before.frame.index(0, y)),
          before.frame.width,
          map.cells.begin() + static_cast<std::ptrdiff_t>(map.frame.index(shift_x, y + shift_y)));
    }
  }

  void take_tree(const json::value& tree, RecordedDecision& decision) const {
    const auto numbers = [&](const char* name) {
      const json::value* array = member(tree, name);
      return array ? unpacked(*array, fmt::format("{}, {}", state_.name, name))
                   : std::vector<double>();
    };
    const std::vector<double> positions = numbers("positions"), parents = numbers("parents"),
                              values = numbers("values");
    if (positions.size() != 2 * parents.size() || values.size() != parents.size()) return;
    for (std::size_t k = 0; k < parents.size(); ++k) {
      decision.nodes.push_back({positions[2 * k], positions[2 * k + 1]});
      const bool inner = parents[k] >= 0.0 && parents[k] < static_cast<double>(parents.size());
      decision.parents.push_back(inner ? static_cast<int>(parents[k]) : -1);
    }
    decision.values = values;
  }

  void take_scan() {
    const json::value* packed = member(*scan_, "ranges");
    if (!packed) return;
    const double first = number(*scan_, "first_angle"), step = number(*scan_, "angle_step"),
                 most = number(*scan_, "max_range");
    double angle = heading_ + first;
    for (const double range : unpacked(*packed, state_.name + ", ranges")) {
      if (range > 0.0 && range < most) {
        state_.scan.push_back(
            {state_.robot.x + range * std::cos(angle), state_.robot.y + range * std::sin(angle)});
      }
      angle += step;
    }
  }

  RecordedState state_;
  int first_x_ = 0, first_y_ = 0;      ///< cells from the recorded origin to that of the box
  const json::value* scan_ = nullptr;  ///< the newest
  double heading_ = 0.0;
};

}  // namespace

RecordedState recorded_state(std::string_view exploration, std::optional<int> decision) {
  json::parse_options options;
  options.allow_invalid_utf8 = true;  // names of floors
  json::error_code error;
  const json::value recording = json::parse(exploration, error, {}, options);
  if (error)
    throw Error(ErrorCode::input,
                "the recording of an exploration is not JSON: " + error.message());
  const json::value* header = member(recording, "header");
  const json::value* robot = header ? member(*header, "robot") : nullptr;
  const std::string name = text(recording, "name");
  Replay replay(name, robot ? number(*robot, "radius") : 0.0);
  double last = -1.0;  // of those before
  for (const json::value& line : list(recording, "lines")) {
    const bool decides = member(line, "kind") != nullptr;
    if (!decides) replay.take(line);
    if (!decides || !decision) continue;
    const double which = number(line, "decision");
    if (which != *decision) {
      if (which > last) last = which;
      continue;
    }
    replay.decide(line);
    return std::move(replay).finish();
  }
  if (decision) {
    throw Error(ErrorCode::input,
                last < 0.0 ? fmt::format("{}: the recording has no decisions", name)
                           : fmt::format("{}: there is no decision {}; the last one is {:.0f}",
                                         name, *decision, last));
  }
  return std::move(replay).finish();
}

}  // namespace cairn::plot
