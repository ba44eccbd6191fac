// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "cairn/io/time_stamps.hpp"
#include "draft.hpp"

namespace cairn::formats {

/// The time stamps of a trajectory's rows, each of which is a variable of the draft, and what
/// follows from them: ids, and which rows are left out.
class StampedRows {
 public:
  /// What a whole number is where nothing says so.
  enum class Whole { id, nanoseconds };

  /// `text` is the field that holds `stamp`; it must outlive this.
  void add(std::string_view text, double stamp);

  /// Sets the ids of the draft's variables: the stamps themselves if all are integers and may be
  /// ids, else the numbers of the rows, which must then not go back in time. Of rows with one stamp
  /// the first is kept. Fills `ReadReport::stamps`, `row_ids` and `notes`. `unit`: what the file
  /// says that the stamps count. Throws `Error` (input) with file and line.
  void finish(Draft& draft, Whole whole, std::optional<StampUnit> unit);

 private:
  StampUnit unit_of(Whole whole) const;
  void leave_out_repeated(Draft& draft, bool are_ids);
  void check_order(Draft& draft) const;

  std::vector<std::string_view> texts_;
  std::vector<double> stamps_;
};

}  // namespace cairn::formats
