// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "cairn/io/time_stamps.hpp"

namespace cairn::formats {

/// A text of rows of numbers as trajectories have them, made fit for a `Scanner`: commas and
/// semicolons between fields become spaces, a line with the names of the columns a comment, and
/// commas of decimals points where the text has no point. Lines keep their numbers. A text that
/// begins otherwise is left as it is.
class RowText {
 public:
  /// `text` must outlive this.
  explicit RowText(std::string_view text);
  RowText(const RowText&) = delete;
  RowText& operator=(const RowText&) = delete;

  std::string_view text() const { return own_.empty() ? given_ : std::string_view(own_); }
  bool is_changed() const { return !own_.empty(); }
  /// Between fields; semicolons, too.
  bool has_commas() const { return has_commas_; }
  /// The column, from 0, of a quaternion's w by the names of the columns; none if they do not say.
  std::optional<int> column_of_w() const { return column_of_w_; }
  /// The unit of the first column by its name, as in "#timestamp [ns]"; none if it does not say.
  std::optional<StampUnit> stamp_unit() const { return stamp_unit_; }

 private:
  void read_names(std::string_view line);

  std::string_view given_;
  std::string own_;  // a changed copy
  bool has_commas_ = false;
  std::optional<int> column_of_w_;
  std::optional<StampUnit> stamp_unit_;
};

}  // namespace cairn::formats
