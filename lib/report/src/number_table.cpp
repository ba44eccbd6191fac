// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/number_table.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <sstream>
#include <system_error>

#include <fmt/core.h>
#include <boost/tokenizer.hpp>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void refuse(const std::string& file, std::size_t line, const std::string& why) {
  throw Error(ErrorCode::input, fmt::format("{}:{}: {}", file, line, why));
}

/// The fields of a line; within quotes a comma is text.
std::vector<std::string> fields_of(const std::string& line) {
  using Separator = boost::escaped_list_separator<char>;
  const boost::tokenizer<Separator> fields(line, Separator('\0', ',', '"'));
  return {fields.begin(), fields.end()};
}

double number_of(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  double number = kNaN;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? number : kNaN;
}

}  // namespace

const NumberTable::Column* NumberTable::find(std::string_view column) const {
  const auto found = std::ranges::find(columns, column, &Column::name);
  return found == columns.end() ? nullptr : &*found;
}

NumberTable read_number_table(std::string_view text, const std::string& file) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";  // what spreadsheets put before UTF-8
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  NumberTable table;
  table.name = file;
  std::istringstream lines{std::string(text)};
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty()) continue;
    if (line.find('\0') != std::string::npos) refuse(file, number, "expected text");
    if (std::ranges::count(line, '"') % 2 != 0) refuse(file, number, "a quote is not closed");
    const std::vector<std::string> fields = fields_of(line);
    if (table.columns.empty()) {
      for (const std::string& name : fields) table.columns.push_back({name, {}});
      continue;
    }
    if (fields.size() != table.columns.size()) {
      refuse(file, number,
             fmt::format("expected {} fields, as many as the first line has, found {}",
                         table.columns.size(), fields.size()));
    }
    for (std::size_t k = 0; k < fields.size(); ++k)
      table.columns[k].values.push_back(number_of(fields[k]));
  }
  if (table.columns.empty() || table.columns.front().values.empty())
    refuse(file, number, "expected CSV: a line with the columns' names, then rows");
  return table;
}

std::string csv_field(std::string_view text) {
  if (text.find_first_of(",\"\n\r") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string csv_text(const NumberTable& table) {
  std::string text;
  const auto separator = [&](std::size_t k) { return k + 1 < table.columns.size() ? "," : "\n"; };
  for (std::size_t k = 0; k < table.columns.size(); ++k)
    text += csv_field(table.columns[k].name) + separator(k);
  const std::size_t rows = table.columns.empty() ? 0 : table.columns.front().values.size();
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < table.columns.size(); ++k) {
      const double value = table.columns[k].values[row];
      text += (std::isnan(value) ? std::string() : fmt::format("{}", value)) + separator(k);
    }
  }
  return text;
}

}  // namespace cairn
