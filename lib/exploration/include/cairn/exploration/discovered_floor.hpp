// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <unordered_set>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What of a floor has ever been known, by squares with a side of 0.3 m, or of a cell if that is
/// more. The area that a map knows at a time does not say whether a robot still finds something: a
/// map that is made anew knows less if it is less blurred, and more if it is blurred more.
class CAIRN_API DiscoveredFloor {
 public:
  /// Whether at least half of some square is known of which that never was.
  bool grows(const FloorMap& map);
  /// Nothing has been known.
  void forget() { squares_.clear(); }

 private:
  std::unordered_set<std::uint64_t> squares_;
  std::vector<int> known_;  // cells, by square of the map
};

}  // namespace cairn
