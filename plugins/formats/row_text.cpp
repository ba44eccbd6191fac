// SPDX-License-Identifier: BSD-3-Clause
#include "row_text.hpp"

#include <algorithm>
#include <cctype>
#include <vector>

namespace cairn::formats {
namespace {

constexpr std::string_view kBlanks = " \t\r";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
}

std::string lower(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(), [](unsigned char c) { return std::tolower(c); });
  return small;
}

/// Between the fields of a line of words or numbers: semicolons, else commas, else blanks.
std::string_view separators_of(std::string_view line) {
  if (line.find(';') != std::string_view::npos) return ";";
  return line.find(',') == std::string_view::npos ? kBlanks : ",";
}

/// What stands between semicolons or commas, or between blanks where there are none. A unit in
/// brackets goes with the name before it: "p_x [m]".
std::vector<std::string> fields_of(std::string_view line) {
  const std::string_view separators = separators_of(line);
  std::vector<std::string> fields;
  bool in_unit = false;
  while (!line.empty()) {
    const std::size_t end = std::min(line.find_first_of(separators), line.size());
    const std::string field = lower(trimmed(line.substr(0, end)));
    line.remove_prefix(std::min(end + 1, line.size()));
    if (separators != kBlanks) {
      fields.push_back(field);
      continue;
    }
    if (field.empty()) continue;
    in_unit = in_unit || (field.front() == '[' && !fields.empty());
    in_unit ? fields.back() += " " + field : fields.emplace_back(field);
    if (field.back() == ']') in_unit = false;
  }
  return fields;
}

/// "q_rs_w []", "qw", "w"; not "b_w_rs_s_x".
bool names_w(std::string_view field) {
  const std::string_view name = trimmed(field.substr(0, field.find_first_of("[(")));
  return name == "w" || name.ends_with("qw") || name.ends_with("_w") || name.ends_with(".w");
}

std::optional<StampUnit> unit_in(std::string_view field) {
  if (field.find("[ns]") != std::string_view::npos) return StampUnit{"nanoseconds", -9};
  if (field.find("[us]") != std::string_view::npos) return StampUnit{"microseconds", -6};
  if (field.find("[ms]") != std::string_view::npos) return StampUnit{"milliseconds", -3};
  if (field.find("[s]") != std::string_view::npos) return StampUnit{};
  return std::nullopt;
}

/// Whether a line that is no comment names the columns of a trajectory.
bool is_names(std::string_view line) {
  if (std::isalpha(static_cast<unsigned char>(line.front())) == 0) return false;
  const std::vector<std::string> fields = fields_of(line);
  if (fields.size() < 3) return false;
  const std::string& first = fields.front();
  return first == "t" || first.find("time") != std::string::npos ||
         first.find("stamp") != std::string::npos;
}

/// By commas or semicolons. Not "1,5 2,5 0,5", whose commas are those of decimals.
bool is_separated_by_marks(std::string_view line) {
  if (separators_of(line) == kBlanks) return false;
  const std::vector<std::string> fields = fields_of(line);
  return fields.size() >= 3 && std::ranges::all_of(fields, [](const std::string& field) {
           return !field.empty() && field.find_first_of(kBlanks) == std::string::npos;
         });
}

/// "1,5 2,5 0", "1,5;2": a single comma between spaces is a mistake.
bool has_decimal_commas_in(std::string_view line) {
  const auto commas = std::ranges::count(line, ',');
  return separators_of(line) == ";" ? commas > 0 : commas > 1 && !is_separated_by_marks(line);
}

bool begins_number(std::string_view line) {
  return std::isdigit(static_cast<unsigned char>(line.front())) != 0 ||
         std::string_view("+-.").find(line.front()) != std::string_view::npos;
}

}  // namespace

RowText::RowText(std::string_view text) : given_(text) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  std::size_t at = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  bool has_decimal_commas = false;
  std::optional<std::size_t> names;  // where a line with names that is no comment begins
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = trimmed(text.substr(at, end - at));
    if (!line.empty()) {
      const bool comment = line.front() == '#';
      if (!comment && (names || !is_names(line))) {
        if (!begins_number(line)) return;  // no rows
        has_commas_ = is_separated_by_marks(line);
        has_decimal_commas = has_decimal_commas_in(line) && text.find('.') == text.npos;
        break;
      }
      if (!comment) names = static_cast<std::size_t>(line.data() - text.data());
      read_names(comment ? line.substr(1) : line);
    }
    at = end + 1;
  }
  if (!names && !has_commas_ && !has_decimal_commas) return;
  own_ = text;
  if (names) own_[*names] = '#';
  if (has_decimal_commas) std::ranges::replace(own_, ',', '.');
  if (has_commas_)
    std::ranges::replace_if(
        own_, [](char c) { return c == ',' || c == ';'; }, ' ');
}

void RowText::read_names(std::string_view line) {
  const std::vector<std::string> fields = fields_of(line);
  if (fields.size() < 8) return;  // a remark
  const auto w = std::ranges::find_if(fields, names_w);
  if (w != fields.end()) column_of_w_ = static_cast<int>(w - fields.begin());
  stamp_unit_ = unit_in(fields.front());
}

}  // namespace cairn::formats
