// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Named columns of numbers, such as the rows of a CSV file: what a plot of columns draws.
struct CAIRN_API NumberTable {
  struct Column {
    std::string name;
    std::vector<double> values;  ///< as many in every column; NaN where a field is no number
    bool operator==(const Column&) const = default;
  };
  std::string name;
  std::vector<Column> columns;

  /// The column of that name, or null.
  const Column* find(std::string_view column) const;
  bool operator==(const NumberTable&) const = default;
};

/// Reads comma-separated values, whose first line names the columns; a field in quotes may have
/// commas, but no line end. Empty lines are skipped. `file` is what messages and the table call it.
/// Throws `Error` (input), with the line, where a row has not as many fields as the first, a quote
/// is not closed, or there is no row.
CAIRN_API NumberTable read_number_table(std::string_view text, const std::string& file);

/// The text that `read_number_table` reads; NaN is an empty field.
CAIRN_API std::string csv_text(const NumberTable& table);

/// Text as a field of CSV, quoted if need be (RFC 4180).
CAIRN_API std::string csv_field(std::string_view text);

}  // namespace cairn
