// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace cairn::formats {

/// Builds lines of fields. Numbers are written with the fewest digits that read back as the same
/// double.
class LineWriter {
 public:
  LineWriter& field(std::string_view text) {
    separate();
    text_ += text;
    return *this;
  }
  LineWriter& field(std::int64_t whole) { return converted(whole); }
  LineWriter& field(double number) { return converted(number); }
  LineWriter& fields(std::span<const double> numbers) {
    for (const double number : numbers) field(number);
    return *this;
  }
  void end_line() {
    text_ += '\n';
    at_start_ = true;
  }
  std::string take() { return std::move(text_); }
  bool empty() const { return text_.empty(); }

 private:
  template <class Number>
  LineWriter& converted(Number number) {
    separate();
    char buffer[32];  // the longest: -2.2250738585072014e-308
    const auto result = std::to_chars(buffer, buffer + sizeof buffer, number);
    text_.append(buffer, result.ptr);
    return *this;
  }
  void separate() {
    if (!at_start_) text_ += ' ';
    at_start_ = false;
  }

  std::string text_;
  bool at_start_ = true;
};

}  // namespace cairn::formats
