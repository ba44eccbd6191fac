// SPDX-License-Identifier: BSD-3-Clause
#include "stamped_rows.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include <fmt/core.h>

namespace cairn::formats {
namespace {

bool is_whole(double stamp) { return stamp >= 0.0 && stamp == std::floor(stamp); }

/// A stamp that can be an id: an integer from 0 that a double holds exactly.
bool can_be_id(double stamp) { return is_whole(stamp) && stamp <= 9007199254740992.0; }

/// Whole seconds since 1970, of this age.
bool is_recent_second(double stamp) { return stamp >= 1.0e9 && stamp < 2.25e9; }

bool same_pose(const Draft& draft, const Draft::Variable& a, const Draft::Variable& b) {
  const int size = draft.variable(a.kind).size;
  for (std::size_t k = 0; k < static_cast<std::size_t>(size); ++k) {
    if (draft.number(a.numbers + k) != draft.number(b.numbers + k)) return false;
  }
  return true;
}

std::string repeated_note(std::size_t rows, std::int64_t first_line, std::size_t other_poses) {
  std::string note = fmt::format(
      "{} the stamp of an earlier row, the first in line {}: of rows with one stamp the first is "
      "kept",
      rows == 1 ? "1 row has" : fmt::format("{} rows have", rows), first_line);
  if (other_poses > 0)
    note += fmt::format(", though {} of the others {} another pose", other_poses,
                        other_poses == 1 ? "has" : "have");
  return note;
}

}  // namespace

void StampedRows::add(std::string_view text, double stamp) {
  texts_.push_back(text);
  stamps_.push_back(stamp);
}

StampUnit StampedRows::unit_of(Whole whole) const {
  const StampUnit recent = stamp_unit(stamps_);
  if (recent.exponent != 0 || whole == Whole::id) return recent;
  const bool nanoseconds =
      std::ranges::all_of(stamps_, is_whole) && !std::ranges::all_of(stamps_, is_recent_second);
  return nanoseconds ? StampUnit{"nanoseconds", -9} : recent;
}

void StampedRows::finish(Draft& draft, Whole whole, std::optional<StampUnit> stated) {
  const StampUnit unit = stated ? *stated : unit_of(whole);
  if (unit.exponent != 0) {
    for (std::size_t k = 0; k < stamps_.size(); ++k) stamps_[k] = seconds_of(texts_[k], unit);
  }
  const bool are_ids =
      whole == Whole::id && unit.exponent == 0 && std::ranges::all_of(stamps_, can_be_id);
  leave_out_repeated(draft, are_ids);
  if (!are_ids) check_order(draft);

  std::vector<Draft::Variable>& rows = draft.variables();
  for (std::size_t k = 0; k < rows.size(); ++k)
    rows[k].id = static_cast<Id>(are_ids ? stamps_[k] : k);
  ReadReport& report = draft.report();
  report.row_ids = !are_ids;
  if (unit.exponent != 0) {
    report.notes.push_back(fmt::format(
        "the stamps are {}, read as seconds; ids are the row numbers from 0", unit.name));
  } else if (!are_ids) {
    report.notes.push_back(whole == Whole::id
                               ? "the stamps are not integers: ids are the row numbers from 0"
                               : "ids are the row numbers from 0");
  }
  if (are_ids) std::ranges::sort(stamps_);
  report.stamps = std::move(stamps_);
}

/// Recorders write an instant twice, or with few digits.
void StampedRows::leave_out_repeated(Draft& draft, bool are_ids) {
  std::vector<Draft::Variable>& rows = draft.variables();
  std::unordered_map<double, std::size_t> seen;  // where ids may come in any order
  std::size_t kept = 0, other_poses = 0;
  std::int64_t first_line = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    std::optional<std::size_t> earlier;
    if (are_ids) {
      const auto [there, is_new] = seen.emplace(stamps_[k], kept);
      if (!is_new) earlier = there->second;
    } else if (kept > 0 && stamps_[k] == stamps_[kept - 1]) {
      earlier = kept - 1;
    }
    if (earlier) {
      other_poses += !same_pose(draft, rows[*earlier], rows[k]);
      if (first_line == 0) first_line = rows[k].line;
      continue;
    }
    rows[kept] = rows[k];
    stamps_[kept] = stamps_[k];
    ++kept;
  }
  const std::size_t repeated = rows.size() - kept;
  if (repeated == 0) return;
  if (kept == 1 && repeated > 1) {
    draft.fail(first_line, fmt::format("stamp {} as in every other row; expected a time, or an id, "
                                       "of its own for each pose",
                                       stamps_.front()));
  }
  rows.resize(kept);
  stamps_.resize(kept);
  draft.report().notes.push_back(repeated_note(repeated, first_line, other_poses));
}

void StampedRows::check_order(Draft& draft) const {
  for (std::size_t k = 1; k < stamps_.size(); ++k) {
    if (stamps_[k] > stamps_[k - 1]) continue;
    draft.fail(draft.variables()[k].line, fmt::format("stamp {} after {}; expected rising stamps",
                                                      stamps_[k], stamps_[k - 1]));
  }
}

}  // namespace cairn::formats
