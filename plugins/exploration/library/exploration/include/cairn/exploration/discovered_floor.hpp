// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What of a floor has ever been known, by squares of whole cells with a side of about 0.3 m. The
/// area that a map knows at a time does not say whether a robot still finds something: a map that
/// is made anew knows less if it is less blurred, and more if it is blurred more.
class CAIRN_API DiscoveredFloor {
 public:
  /// Whether the map knows at least half of some square of which it never has before. All maps must
  /// have cells of one size, at multiples of it.
  bool grows(const FloorMap& map);

 private:
  void cover(const Eigen::Vector2i& low, const Eigen::Vector2i& high);
  std::size_t index(int x, int y) const;

  Eigen::Vector2i low_ = Eigen::Vector2i::Zero(), size_ = Eigen::Vector2i::Zero();  // squares
  std::vector<std::uint8_t> ever_;  // by square, whether half of it has been known
  std::vector<int> known_;          // cells of each, of the newest map
};

}  // namespace cairn
