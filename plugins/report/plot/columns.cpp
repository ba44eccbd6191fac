// SPDX-License-Identifier: BSD-3-Clause
// Columns of tables against one of them.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <string>
#include <vector>

#include <fnmatch.h>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "chart.hpp"
#include "lines.hpp"
#include "plots.hpp"

namespace cairn::plot {
namespace {

using Column = NumberTable::Column;

bool has_numbers(const Column& column) {
  return std::ranges::any_of(column.values, [](double value) { return std::isfinite(value); });
}

std::string column_names(const NumberTable& table) {
  std::vector<std::string> names;
  for (const Column& column : table.columns) names.push_back(column.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

const Column& horizontal(const NumberTable& table, const std::string& name) {
  const Column* column = name.empty() ? &table.columns.front() : table.find(name);
  if (!column) {
    throw Error(ErrorCode::usage, fmt::format("{} has no column '{}'; it has {}", table.name, name,
                                              column_names(table)));
  }
  if (!has_numbers(*column)) {
    throw Error(ErrorCode::input,
                fmt::format("column '{}' of {} has no number", column->name, table.name));
  }
  return *column;
}

/// The columns with numbers that a pattern selects, but for the horizontal axis.
std::vector<const Column*> selected(const NumberTable& table, const Column& x,
                                    const std::string& pattern) {
  std::vector<const Column*> columns;
  for (const Column& column : table.columns) {
    if (&column == &x || !has_numbers(column)) continue;
    if (fnmatch(pattern.c_str(), column.name.c_str(), 0) == 0) columns.push_back(&column);
  }
  return columns;
}

/// Without what is beyond the right end.
void cut(Line& line, double right) {
  std::size_t left = 0;
  for (std::size_t i = 0; i < line.x.size(); ++i) {
    if (line.x[i] > right) continue;
    line.x[left] = line.x[i];
    line.y[left++] = line.y[i];
  }
  line.x.resize(left);
  line.y.resize(left);
}

/// The words before the one * of a pattern, such as "map_error" of "map_error *", which columns of
/// several methods begin with.
std::string first_words(const std::string& pattern) {
  return pattern.ends_with(" *") && pattern.find_first_of("*?[") + 1 == pattern.size()
             ? pattern.substr(0, pattern.size() - 2)
             : "";
}

struct Panel {
  LineChart chart;
  std::vector<Line> lines;
};

/// Lines are named after what tells them apart: the column, the table, or both.
Panel panel_of(const std::vector<NumberTable>& tables, const PlotOptions& options,
               const std::string& pattern) {
  Panel panel;
  std::vector<std::string> names;  // of the columns, each once
  const std::string common = first_words(pattern);
  const bool one_each =
      !common.empty() && std::ranges::all_of(tables, [&](const NumberTable& table) {
        return selected(table, horizontal(table, options.x), pattern).size() == 1;
      });
  for (const NumberTable& table : tables) {
    const Column& x = horizontal(table, options.x);
    panel.chart.x_label = x.name;
    for (const Column* column : selected(table, x, pattern)) {
      const std::string name = tables.size() == 1 ? column->name
                               : one_each         ? table.name
                                                  : fmt::format("{}: {}", table.name, column->name);
      panel.lines.push_back({name, x.values, column->values});
      cut(panel.lines.back(), options.x_max);
      if (std::ranges::find(names, column->name) == names.end()) names.push_back(column->name);
    }
  }
  if (panel.lines.empty()) {
    throw Error(ErrorCode::usage,
                fmt::format("no column with numbers matches '{}'; {} has {}", pattern,
                            tables.front().name, column_names(tables.front())));
  }
  panel.chart.y_label = names.size() == 1 ? names.front() : common;
  const std::string what = !common.empty()     ? common
                           : names.size() <= 3 ? fmt::format("{}", fmt::join(names, ", "))
                           : pattern == "*"    ? tables.front().name
                                               : pattern;
  panel.chart.title = fmt::format("{} against {}", what, panel.chart.x_label);
  const Logarithmic log = options.logarithmic;
  panel.chart.logarithmic_x = log == Logarithmic::x || log == Logarithmic::both;
  panel.chart.logarithmic_y = log == Logarithmic::y || log == Logarithmic::both;
  return panel;
}

std::vector<std::string> patterns(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) all.push_back(line);
  if (all.empty()) all.emplace_back("*");
  return all;
}

}  // namespace

void draw_columns(Canvas& canvas, const Theme& theme, const Album& album,
                  const PlotOptions& options) {
  if (album.tables.empty()) {
    throw Error(ErrorCode::input,
                "no columns to draw: give CSV, such as cairn replay --steps writes");
  }
  std::vector<Panel> all;
  for (const std::string& pattern : patterns(options.y_columns))
    all.push_back(panel_of(album.tables, options, pattern));
  for (const Panel& panel : all) {
    if (std::ranges::none_of(panel.lines,
                             [&](const Line& line) { return can_be_drawn(panel.chart, line); })) {
      throw Error(ErrorCode::input,
                  fmt::format("{}: no point can be drawn: logarithmic axes have positive numbers "
                              "only, and what is beyond the right end is left out",
                              panel.chart.title));
    }
  }
  const std::vector<Box> boxes = panels(canvas, all.size());
  for (std::size_t k = 0; k < all.size(); ++k)
    draw_lines(canvas, theme, boxes[k], all[k].chart, all[k].lines);
}

}  // namespace cairn::plot
