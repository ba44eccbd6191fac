// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/recording.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <boost/json/object.hpp>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "cairn/exploration/exploration_measures.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/report/recording.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace json = boost::json;

constexpr double kMostCells = 1e8;
constexpr const char* kMapEntropy = "map_entropy";
constexpr const char* kGridArea = "grid_area";
constexpr std::array kColumns{"distance",           "step", "decision", "coverage",  kMapEntropy,
                              "trajectory_entropy", "kept", "loops",    "collisions"};

std::optional<json::object> parsed(std::string_view text) {
  json::parse_options options;
  options.allow_invalid_utf8 = true;  // names of floors
  json::error_code error;
  json::value value = json::parse(text, error, {}, options);
  if (error || !value.is_object()) return std::nullopt;
  return std::move(value.get_object());
}

/// Parses a line, and checks what a page relies on; `where` is in every message.
class Line {
 public:
  Line(std::string_view text, std::string where) : where_(std::move(where)) {
    auto object = parsed(text);
    if (!object) fail("is not a JSON object");
    object_ = std::move(*object);
  }

  [[noreturn]] void fail(std::string_view what) const {
    throw Error(ErrorCode::input, fmt::format("{}: {}", where_, what));
  }
  bool has(const char* member) const { return object_.contains(member); }
  double number(const char* member) const {
    const json::value* value = object_.if_contains(member);
    return value && value->is_number() ? value->to_number<double>()
                                       : std::numeric_limits<double>::quiet_NaN();
  }
  std::string text(const char* member) const {
    const json::value* value = object_.if_contains(member);
    return value && value->is_string()
               ? std::string(value->get_string().data(), value->get_string().size())
               : "";
  }

  void check() const {
    if (!has("step") && !has("decision") && !has("end"))
      fail("is neither a motion nor a decision nor the end");
    if (const json::object* map = object("map", object_)) check_map(*map);
    if (const json::object* scan = object("scan", object_)) check_array(*scan, "ranges", -1.0);
    if (const json::object* tree = object("tree", object_)) {
      const double count = number_of(*tree, "count");
      check_array(*tree, "positions", 2.0 * count);
      check_array(*tree, "parents", count);
      check_array(*tree, "values", count);
    }
  }

 private:
  const json::object* object(const char* member, const json::object& in) const {
    const json::value* value = in.if_contains(member);
    if (!value) return nullptr;
    if (!value->is_object()) fail(fmt::format("'{}' is not an object", member));
    return &value->get_object();
  }
  double number_of(const json::object& in, const char* member) const {
    const json::value* value = in.if_contains(member);
    if (!value || !value->is_number()) fail(fmt::format("'{}' is not a number", member));
    return value->to_number<double>();
  }
  void check_map(const json::object& map) const {
    const double width = number_of(map, "width"), height = number_of(map, "height");
    const bool whole = width == std::floor(width) && height == std::floor(height);
    if (!whole || !(width > 0.0) || !(height > 0.0) || !(width * height <= kMostCells))
      fail("a map of that size cannot be");
    for (const char* corner : {"x", "y"}) {
      if (!(std::abs(number_of(map, corner)) <= kMostCells))
        fail("a part of the map is too far off");
    }
    check_array(map, "cells", width * height);
  }
  /// `count`: of numbers; negative: any.
  void check_array(const json::object& in, const char* member, double count) const {
    const json::object* array = object(member, in);
    if (!array) fail(fmt::format("'{}' is missing", member));
    const double size = number_of(*array, "count");
    if (!(size >= 0.0 && size <= kMostCells) || (count >= 0.0 && size != count))
      fail(fmt::format("'{}' does not have as many numbers as it should", member));
    const json::value* type = array->if_contains("type");
    const json::value* deflate = array->if_contains("deflate");
    const json::value* text = deflate ? deflate : array->if_contains("base64");
    if (!type || !type->is_string() || !text || !text->is_string())
      fail(fmt::format("'{}' is not a packed array", member));
    unpack_numbers(type->get_string(), text->get_string(),
                   deflate ? Packing::deflate : Packing::base64, static_cast<std::size_t>(size),
                   fmt::format("{}, {}", where_, member));
  }

  json::object object_;
  std::string where_;
};

void add_row(const Line& line, NumberTable& table) {
  for (NumberTable::Column& column : table.columns)
    column.values.push_back(line.number(column.name.c_str()));
}

void add_line(std::string_view text, const std::string& where, ExplorationRecording& recording) {
  const Line line(text, where);
  line.check();
  if (recording.ended) line.fail("something follows the end");
  if (line.has("step")) {
    add_row(line, recording.steps);
  } else if (line.has("decision")) {
    ++recording.decisions;
  } else {
    recording.ended = true;
  }
  recording.lines.emplace_back(text);
}

void read_header(std::string_view text, const std::string& where, const std::string& name,
                 ExplorationRecording& recording) {
  const Line header(text, where);
  if (header.number("version") != 1.0)
    header.fail("a version of recordings that this program does not know; expected 1");
  recording.name = header.text("name");
  if (recording.name.empty()) recording.name = name;
  recording.header = std::string(text);
}

NumberTable::Column& column_of(NumberTable& table, std::string_view name) {
  return *std::ranges::find(table.columns, name, &NumberTable::Column::name);
}

/// Where the floor is not known, the entropy of a map is over its own grid, which grows: over the
/// largest all are comparable. Recordings of earlier versions don't say over which area theirs is.
void put_over_one_area(NumberTable& steps) {
  const NumberTable::Column areas = std::move(steps.columns.back());  // kGridArea
  steps.columns.pop_back();
  double largest = 0.0;
  for (const double area : areas.values) largest = std::max(largest, area);  // not a NaN
  if (!(largest > 0.0)) return;
  std::vector<double>& entropies = column_of(steps, kMapEntropy).values;
  for (std::size_t k = 0; k < entropies.size(); ++k) {
    if (areas.values[k] > 0.0)
      entropies[k] = entropy_of_area(entropies[k], areas.values[k], largest);
  }
}

std::size_t size_of(const std::vector<std::string>& lines) {
  std::size_t size = 0;
  for (const std::string& line : lines) size += line.size() + 1;
  return size;
}

/// Leaves `member` out of every second of the lines that have it.
std::vector<std::string> thinned(const std::vector<std::string>& lines, const char* member) {
  std::vector<std::string> less;
  bool keep = false;
  const std::string quoted = fmt::format("\"{}\"", member);
  for (const std::string& line : lines) {
    less.push_back(line);
    if (line.find(quoted) == std::string::npos) continue;
    json::object object = parsed(line).value_or(json::object());
    if (!object.contains(member) || (keep = !keep)) continue;
    object.erase(member);
    less.back() = json::serialize(object);
  }
  return less;
}

}  // namespace

bool is_exploration_recording(std::string_view head) {
  if (!is_recording(head)) return false;
  const std::optional<json::object> header = parsed(head.substr(0, head.find('\n')));
  const json::value* kind = header ? header->if_contains("kind") : nullptr;
  return kind && *kind == "exploration";
}

ExplorationRecording read_exploration_recording(std::string_view text, const std::string& name) {
  ExplorationRecording recording;
  for (const char* column : kColumns) recording.steps.columns.push_back({column, {}});
  recording.steps.columns.push_back({kGridArea, {}});
  recording.steps.name = name;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) {
      recording.torn = true;
      break;
    }
    const std::string where = fmt::format("{}:{}", name, number);
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    if (number == 1)
      read_header(line, where, name, recording);
    else
      add_line(line, where, recording);
  }
  if (recording.steps.columns.front().values.empty())
    throw Error(ErrorCode::input, fmt::format("{}: not even the start was recorded", name));
  put_over_one_area(recording.steps);
  return recording;
}

std::string exploration_json(const ExplorationRecording& recording, const std::string& name,
                             std::size_t most_bytes, std::vector<std::string>& notes) {
  constexpr std::size_t kMostStrides = 1 << 20;
  std::vector<std::string> lines = recording.lines;
  for (const auto& [member, what] : {std::pair{"tree", "trees of decisions"}, {"scan", "scans"}}) {
    std::size_t stride = 1;
    while (size_of(lines) > most_bytes && stride < kMostStrides) {
      stride *= 2;
      lines = thinned(lines, member);
    }
    if (stride == 1) continue;
    notes.push_back(fmt::format("{}: one in {} of the {} is shown at most, to keep the file small",
                                name, stride, what));
  }
  return fmt::format(R"({{"name":{},"complete":{},"header":{},"lines":[{}]}})", json_string(name),
                     recording.ended, recording.header, fmt::join(lines, ",\n"));
}

}  // namespace cairn
