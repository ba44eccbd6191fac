// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cairn::app {

/// How many columns results may take: those of the terminal that standard output is, else 100.
std::size_t output_width();

/// Columns that align, whatever UTF-8 the cells hold, in lines that are not too long.
class Table {
 public:
  enum class Align { left, right };
  struct Column {
    std::string title;
    Align align = Align::left;
    /// Columns with the largest rank are left out first where there is no room for all; 0: never.
    int dispensable = 0;
  };

  explicit Table(std::vector<Column> columns, std::string indent = "")
      : columns_(std::move(columns)), indent_(std::move(indent)) {}
  /// One cell per column; missing ones are empty.
  void add(std::vector<std::string> cells);
  bool empty() const { return rows_.empty(); }

  /// Lines of at most `width` columns. Where the table is wider, dispensable columns are left out
  /// (a last line names them), then texts are folded between words, and what is still too wide is
  /// continued below, each part beginning with the first column. Only a word that is longer than
  /// its column (a path, which must stay whole to be copied) makes a line longer. Without `width`
  /// it is that of the terminal; in files and pipes a table with dispensable columns is as wide as
  /// it is, so that none is left out. With `colour`, the titles are bold. Columns without any title
  /// have no title line.
  std::string text(bool colour, std::size_t width = 0) const;
  /// A tabular of LaTeX with all columns, as wide as it is; it needs no package.
  std::string latex() const;

 private:
  struct Layout;
  Layout natural_layout() const;
  void leave_out(Layout& layout, std::size_t width) const;
  void fold(Layout& layout, std::size_t width) const;
  /// How narrow a column of folded text may become.
  std::size_t least_width(std::size_t column) const;
  std::string part_text(const Layout& layout, const std::vector<std::size_t>& part,
                        bool colour) const;

  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
  std::string indent_;
};

/// The text with control characters written as \x1b and the like, so that no file, plugin or name
/// can command a terminal. Line breaks stay in `lines`.
std::string printable(std::string_view text, bool lines = false);

/// How many columns of a terminal a text takes: its code points, without escape sequences.
std::size_t display_width(std::string_view text);
/// The text if it takes at most `width` columns, else its beginning and "…".
std::string shortened(const std::string& text, std::size_t width);
/// The text in lines of at most `width` columns, broken at spaces and after commas; longer words
/// stay whole.
std::vector<std::string> folded(const std::string& text, std::size_t width);

/// Whether a stream is a terminal.
bool is_terminal(std::FILE* stream);
/// The columns of the terminal that a stream is; 0 if it is none, or does not say.
std::size_t terminal_width(std::FILE* stream);
/// Whether to colour what goes to a stream: on a terminal that can, unless NO_COLOR is set
/// (no-color.org).
bool use_colour(std::FILE* stream);
std::string bold(std::string_view text, bool colour);

// Numbers and lists for people --------------------------------------------------------------------
/// "812 µs", "12.3 ms", "4.56 s"
std::string seconds_text(double seconds);
/// "612 B", "46.9 KiB", "17.7 MiB"; "-" for 0, which stands for not known
std::string bytes_text(std::int64_t bytes);
/// "12 345 678" would not be copied well: plain digits up to 10⁶, then "12.3 M".
std::string count_text(std::int64_t count);
/// Eight significant digits: enough to compare with published values.
std::string chi2_text(double chi2);
/// "1 factor", "2 factors"
std::string plural(std::int64_t count, std::string_view noun);
/// The parts, with `between` between each two. What fmt::join does, without its templates, which
/// take a fifth of a second in each file.
std::string joined(std::span<const std::string> parts, std::string_view between);

/// A row for each note, those that are `doubts` first and so called. More than `most` are counted;
/// doubts never are.
void add_notes(Table& table, const std::vector<std::string>& notes,
               const std::vector<std::string>& doubts,
               std::size_t most = std::numeric_limits<std::size_t>::max());

}  // namespace cairn::app
