// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "cairn/graph/graph.hpp"

namespace cairn::formats {

/// "file:line: " in front of every complaint about a file.
std::string located(std::string_view file, std::int64_t line, std::string_view what);

/// What a line should hold after its tag.
struct Layout {
  int ids = 0;
  int measurement = 0;  ///< numbers of the state or measurement
  int information = 0;  ///< numbers of the information matrix
  /// What messages call that matrix where it is another.
  std::string_view matrix = "information";
  int total() const { return ids + measurement + information; }
};

/// Walks through a text line by line and field by field, without copying any of it.
///
/// Blank lines are passed over, and so is what follows a field that begins with '#'. Fields are
/// separated by spaces and tabs; a line ends with LF or CR LF. Errors are `Error` (input) and name
/// file and line, what was found and what was expected.
class Scanner {
 public:
  /// `text` must outlive the scanner. A byte order mark at its start is passed over. `first_line`
  /// is the number of its first line.
  Scanner(std::string_view text, std::string file, std::int64_t first_line = 1);

  /// Moves to the next line that holds a field; false at the end of the text.
  bool next_line();
  /// The first field of the line.
  std::string_view tag() const { return tag_; }
  std::int64_t line() const { return line_; }
  const std::string& file() const { return file_; }

  /// Reading starts after the tag: says what the line holds, for messages about it.
  void expect(Layout layout);
  /// The same for lines without a tag: reading starts at the first field; messages call the line
  /// `what`.
  void expect_row(Layout layout, std::string_view what);

  Id read_id();
  /// The id that a name stands for, a letter and a number such as A0 (`cairn::symbol`).
  Id read_symbol();
  /// How many of something: an integer from 0 to 2³¹ − 1.
  std::int64_t read_count();
  double read_number();
  void read_numbers(std::span<double> out);
  /// Whether fields are left on this line.
  bool more();
  /// Complains if fields are left.
  void end_line();

  /// As it was expected.
  const Layout& layout() const { return layout_; }
  /// The field after the tag, if it is an id.
  std::optional<Id> id_after_tag() const;
  /// Fields of this line after the tag (or all, in a row).
  int count_fields() const;
  /// The first fields after the tag, as many as `out` has room for; empty where there are fewer.
  void first_fields(std::span<std::string_view> out) const;
  /// The last fields of this line, as many as `out` has room for; empty where there are fewer.
  void last_fields(std::span<std::string_view> out) const;
  [[noreturn]] void fail(std::string_view what) const;

 private:
  std::string_view next_field();
  std::string_view required_field();
  [[noreturn]] void fail_count() const;
  [[noreturn]] void fail_number(std::string_view field) const;
  std::int64_t read_whole(std::string_view what, std::int64_t largest);
  [[noreturn]] void fail_whole(std::string_view field, std::string_view what,
                               std::int64_t largest) const;

  std::string file_;
  std::string_view rest_;    // lines not yet visited
  std::string_view fields_;  // fields of this line not yet read
  std::string_view start_;   // fields of this line, all that are counted
  std::string_view tag_;
  std::string_view subject_;  // how messages call the line
  std::int64_t line_ = 0;
  Layout layout_;
  int read_ = 0;  // fields read since expect
};

/// Whether the whole field is spelled as a number, infinity and NaN among them. Versions of
/// fast_float differ in whether they report what is too large or too small for a double; the value
/// is then infinite, or the nearest double (be it zero), either way.
bool parse_number(std::string_view field, double& number);

/// A field as it is shown in a message: cut short, bytes that cannot be printed as \xNN.
std::string shown(std::string_view field);

}  // namespace cairn::formats
