// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

namespace cairn::app {

/// Columns that align, whatever UTF-8 the cells hold.
class Table {
 public:
  enum class Align { left, right };
  struct Column {
    std::string title;
    Align align = Align::left;
  };

  explicit Table(std::vector<Column> columns, std::string indent = "")
      : columns_(std::move(columns)), indent_(std::move(indent)) {}
  /// One cell a column; missing ones are empty.
  void add(std::vector<std::string> cells);
  bool empty() const { return rows_.empty(); }
  /// With `colour`, the titles are bold. Columns without any title have no title line.
  std::string text(bool colour) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
  std::string indent_;
};

/// How many columns of a terminal a text takes: its code points, without escape sequences.
std::size_t display_width(std::string_view text);

/// Whether a stream is a terminal.
bool is_terminal(std::FILE* stream);
/// Whether to colour what goes to a stream: on a terminal that can, unless NO_COLOR is set
/// (no-color.org).
bool use_colour(std::FILE* stream);
std::string bold(std::string_view text, bool colour);

// Numbers for people -----------------------------------------------------------------------------
/// "812 µs", "12.3 ms", "4.56 s"
std::string seconds_text(double seconds);
/// "12.3 MB" (10⁶ bytes); "-" for 0, which stands for not known
std::string bytes_text(std::int64_t bytes);
/// "12 345 678" would not be copied well: plain digits up to 10⁶, then "12.3 M".
std::string count_text(std::int64_t count);
/// Eight significant digits: enough to compare with published values.
std::string chi2_text(double chi2);
/// "1 factor", "2 factors"
std::string plural(std::int64_t count, std::string_view noun);

}  // namespace cairn::app
