// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/number_table.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <system_error>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void refuse(const std::string& file, std::size_t line, const std::string& why) {
  throw Error(ErrorCode::input, fmt::format("{}:{}: {}", file, line, why));
}

/// Takes one record after the other from the text.
class Records {
 public:
  Records(std::string_view text, const std::string& file) : rest_(text), file_(file) {
    constexpr std::string_view kMark = "\xEF\xBB\xBF";  // what spreadsheets put before UTF-8
    if (rest_.starts_with(kMark)) rest_.remove_prefix(kMark.size());
  }
  /// Where the last record begins, from 1.
  std::size_t line() const { return line_; }

  /// The next record that is not an empty line; false at the end.
  bool next(std::vector<std::string>& fields) {
    fields.clear();
    while (!rest_.empty()) {
      line_ = next_line_;
      fields.emplace_back(field());
      while (!rest_.empty() && rest_.front() == ',') {
        rest_.remove_prefix(1);
        fields.emplace_back(field());
      }
      end_line();
      if (fields.size() > 1 || !fields.front().empty()) return true;
      fields.clear();
    }
    return false;
  }

 private:
  std::string field() {
    if (!rest_.starts_with('"')) {
      const std::size_t end = std::min(rest_.find_first_of(",\r\n"), rest_.size());
      std::string text(rest_.substr(0, end));
      rest_.remove_prefix(end);
      return text;
    }
    std::string text;
    rest_.remove_prefix(1);
    while (true) {
      const std::size_t end = rest_.find('"');
      if (end == std::string_view::npos) refuse(file_, line_, "a quote is not closed");
      text += rest_.substr(0, end);
      next_line_ += static_cast<std::size_t>(std::ranges::count(rest_.substr(0, end), '\n'));
      rest_.remove_prefix(end + 1);
      if (!rest_.starts_with('"')) break;
      text += '"';
      rest_.remove_prefix(1);
    }
    if (!rest_.empty() && rest_.find_first_of(",\r\n") != 0)
      refuse(file_, line_, "expected a comma after a quoted field");
    return text;
  }

  void end_line() {
    if (rest_.starts_with('\r')) rest_.remove_prefix(1);
    if (rest_.starts_with('\n')) rest_.remove_prefix(1);
    ++next_line_;
  }

  std::string_view rest_;
  const std::string& file_;
  std::size_t line_ = 0, next_line_ = 1;
};

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
  NumberTable table;
  table.name = file;
  Records records(text, file);
  std::vector<std::string> fields;
  if (records.next(fields)) {
    for (const std::string& name : fields) table.columns.push_back({name, {}});
  }
  while (records.next(fields)) {
    if (fields.size() != table.columns.size()) {
      refuse(file, records.line(),
             fmt::format("expected {} fields, as many as the first line has, found {}",
                         table.columns.size(), fields.size()));
    }
    for (std::size_t k = 0; k < fields.size(); ++k)
      table.columns[k].values.push_back(number_of(fields[k]));
  }
  if (table.columns.empty() || table.columns.front().values.empty())
    refuse(file, records.line(), "expected CSV: a line with the columns' names, then rows");
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
