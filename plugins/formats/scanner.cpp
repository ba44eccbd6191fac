// SPDX-License-Identifier: BSD-3-Clause
#include "scanner.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include <fast_float/fast_float.h>
#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"

namespace cairn::formats {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

/// Takes the first field off `text`; empty at the end of the line or at a comment.
std::string_view take_field(std::string_view& text) {
  const char* p = text.data();
  const char* const end = p + text.size();
  while (p != end && is_blank(*p)) ++p;
  const char* const begin = p;
  if (p != end && *p == '#') {
    text = {};
    return {};
  }
  while (p != end && !is_blank(*p)) ++p;
  text = std::string_view(p, static_cast<std::size_t>(end - p));
  return {begin, static_cast<std::size_t>(p - begin)};
}

/// '+' in front of a digit or a dot, which the parsers of the standard do not take.
std::string_view without_plus(std::string_view field) {
  return field.size() > 1 && field[0] == '+' && field[1] != '-' && field[1] != '+' ? field.substr(1)
                                                                                   : field;
}

/// What `from_chars` takes of `digits`; false unless that is all of it.
bool parse_whole(std::string_view digits, std::int64_t& whole) {
  const char* const end = digits.data() + digits.size();
  const auto result = std::from_chars(digits.data(), end, whole);
  return result.ec == std::errc{} && result.ptr == end;
}

std::string expected_fields(const Layout& layout) {
  const auto count = [](int n, const char* one, const char* many) {
    return fmt::format("{} {}", n, n == 1 ? one : many);
  };
  std::string parts;
  const auto add = [&parts](const std::string& part) {
    parts += (parts.empty() ? "" : ", ") + part;
  };
  if (layout.ids > 0) add(count(layout.ids, "id", "ids"));
  if (layout.measurement > 0) {
    add(count(layout.measurement, "number", "numbers") +
        (layout.information > 0 ? " of the measurement" : ""));
  }
  if (layout.information > 0) add(fmt::format("{} of the {}", layout.information, layout.matrix));
  return fmt::format("{}{}", count(layout.total(), "field", "fields"),
                     parts.empty() ? "" : fmt::format(" ({})", parts));
}

}  // namespace

std::string located(std::string_view file, std::int64_t line, std::string_view what) {
  return fmt::format("{}:{}: {}", file, line, what);
}

bool parse_number(std::string_view field, double& number) {
  const std::string_view digits = without_plus(field);
  const char* const end = digits.data() + digits.size();
  const auto result = fast_float::from_chars(digits.data(), end, number);
  return (result.ec == std::errc{} || result.ec == std::errc::result_out_of_range) &&
         result.ptr == end;
}

std::string shown(std::string_view field) {
  constexpr std::size_t kLongest = 40;
  std::string out;
  for (const char c : field.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7f) {
      out += c;
    } else {
      out += fmt::format("\\x{:02x}", byte);
    }
  }
  if (field.size() > kLongest) out += "...";
  return out;
}

Scanner::Scanner(std::string_view text, std::string file, std::int64_t first_line)
    : file_(std::move(file)), rest_(text), line_(first_line - 1) {
  if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
}

bool Scanner::next_line() {
  while (!rest_.empty()) {
    const void* newline = std::memchr(rest_.data(), '\n', rest_.size());
    const std::size_t length =
        newline ? static_cast<std::size_t>(static_cast<const char*>(newline) - rest_.data())
                : rest_.size();
    std::string_view text = rest_.substr(0, length);
    rest_.remove_prefix(newline ? length + 1 : length);
    ++line_;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    start_ = text;
    fields_ = text;
    tag_ = take_field(fields_);
    if (!tag_.empty()) return true;
  }
  tag_ = {};
  return false;
}

void Scanner::expect(Layout layout) {
  std::string_view after_tag = start_;
  take_field(after_tag);
  start_ = fields_ = after_tag;
  subject_ = tag_;
  layout_ = layout;
  read_ = 0;
}

void Scanner::expect_row(Layout layout, std::string_view what) {
  fields_ = start_;
  subject_ = what;
  layout_ = layout;
  read_ = 0;
}

std::string_view Scanner::next_field() { return take_field(fields_); }

std::string_view Scanner::required_field() {
  const std::string_view field = next_field();
  if (field.empty()) fail_count();
  ++read_;
  return field;
}

Id Scanner::read_id() { return read_whole("an id", INT64_MAX); }
std::int64_t Scanner::read_count() { return read_whole("a count", INT32_MAX); }

Id Scanner::read_symbol() {
  const std::string_view field = required_field();
  const std::optional<Id> id = id_from_text(field);
  if (!id || !as_symbol(*id)) {
    if (count_fields() != layout_.total()) fail_count();
    fail(fmt::format("field {} of {} is '{}'; expected a name, a letter and a number such as A0",
                     read_, shown(subject_), shown(field)));
  }
  return *id;
}

std::int64_t Scanner::read_whole(std::string_view what, std::int64_t largest) {
  const std::string_view field = required_field();
  const std::string_view digits = without_plus(field);
  std::int64_t whole = 0;
  if (!parse_whole(digits, whole) || whole < 0 || whole > largest) fail_whole(field, what, largest);
  return whole;
}

double Scanner::read_number() {
  const std::string_view field = required_field();
  double number = 0.0;
  if (!parse_number(field, number) || !std::isfinite(number)) fail_number(field);
  return number;
}

void Scanner::read_numbers(std::span<double> out) {
  for (double& number : out) number = read_number();
}

bool Scanner::more() {
  const auto next = std::ranges::find_if_not(fields_, is_blank);
  return next != fields_.end() && *next != '#';
}

void Scanner::end_line() {
  if (more()) fail_count();
}

int Scanner::count_fields() const {
  std::string_view text = start_;
  int fields = 0;
  while (!take_field(text).empty()) ++fields;
  return fields;
}

std::optional<Id> Scanner::id_after_tag() const {
  std::string_view text = start_;
  take_field(text);  // the tag: nothing of this line was expected yet
  const std::string_view digits = without_plus(take_field(text));
  Id id = 0;
  return parse_whole(digits, id) && id >= 0 ? std::optional(id) : std::nullopt;
}

void Scanner::first_fields(std::span<std::string_view> out) const {
  std::string_view text = start_;
  for (std::string_view& field : out) field = take_field(text);
}

void Scanner::last_fields(std::span<std::string_view> out) const {
  const auto fields = static_cast<std::size_t>(count_fields());
  std::string_view text = start_;
  for (std::size_t k = out.size(); k < fields; ++k) take_field(text);
  for (std::string_view& field : out) field = take_field(text);
}

void Scanner::fail(std::string_view what) const {
  throw Error(ErrorCode::input, located(file_, line_, what));
}

void Scanner::fail_count() const {
  fail(fmt::format("{} with {} fields; expected {}", shown(subject_), count_fields(),
                   expected_fields(layout_)));
}

void Scanner::fail_number(std::string_view field) const {
  // A field too many or too few is the likelier cause: say that first.
  if (count_fields() != layout_.total()) fail_count();
  const std::string where =
      fmt::format("field {} of {} is '{}'", read_, shown(subject_), shown(field));
  double number = 0.0;
  if (!parse_number(field, number)) {
    fail(where + ", which is not a number; expected a finite number");
  }
  const bool digits = field.find_first_of("0123456789") != std::string_view::npos;
  fail(where + (digits ? ", which is out of the range of a double" : "") +
       "; expected a finite number");
}

void Scanner::fail_whole(std::string_view field, std::string_view what,
                         std::int64_t largest) const {
  if (count_fields() != layout_.total() && layout_.total() > 0) fail_count();
  fail(fmt::format("field {} of {} is '{}'; expected {}, an integer from 0 to {}", read_,
                   shown(subject_), shown(field), what, largest));
}

}  // namespace cairn::formats
