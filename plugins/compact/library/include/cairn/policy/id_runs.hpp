// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <iterator>
#include <map>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// A set of ids that grows, kept as runs of consecutive ones: the poses of a robot that counts them
/// take the memory of one run, however long it drives.
class IdRuns {
 public:
  /// Does nothing if it is there already.
  void insert(Id id) {
    if (contains(id)) return;
    const auto next = runs_.upper_bound(id);
    Id last = id;
    if (next != runs_.end() && next->first - 1 == id) {  // it leads to the next run
      last = next->second;
      runs_.erase(next);
    }
    const auto after = runs_.upper_bound(id);
    if (after != runs_.begin() &&
        std::prev(after)->second == id - 1) {  // it follows the one before
      std::prev(after)->second = last;
    } else {
      runs_.emplace_hint(after, id, last);
    }
  }
  bool contains(Id id) const {
    const auto after = runs_.upper_bound(id);
    return after != runs_.begin() && id <= std::prev(after)->second;
  }
  std::size_t run_count() const { return runs_.size(); }

 private:
  std::map<Id, Id> runs_;  ///< from the first id of each to its last
};

}  // namespace cairn
