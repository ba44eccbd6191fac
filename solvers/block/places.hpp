// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <span>

namespace cairn::block {

/// Assigns places in one array to update matrices that live from their supernode to its parent,
/// in the order of their lives: first fit, among the lowest `kMostTried` free stretches.
class Places {
 public:
  /// Room for so many doubles.
  std::int64_t take(std::int64_t size);
  void give_back(std::int64_t begin, std::int64_t size);
  /// The size of the array so far.
  std::int64_t end() const { return end_; }

 private:
  static constexpr int kMostTried = 256;

  std::map<std::int64_t, std::int64_t> free_;
  std::int64_t end_ = 0;
};

/// Assigns places in one array to matrices whose lifetimes are known: the largest first, each at
/// the lowest place that is free all its life. Where too many live at the same time for that to be
/// worth its time and memory, first fit in the order of their lives.
///
/// `events`: a matrix begins (s) or ends (~s), in this order. `size`, `place`: doubles, by matrix.
/// Returns the size of the array.
std::int64_t place_by_lifetimes(std::span<const std::int32_t> events,
                                std::span<const std::int64_t> size, std::span<std::int64_t> place);

}  // namespace cairn::block
