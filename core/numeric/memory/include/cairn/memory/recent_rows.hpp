// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace cairn {

/// Finds rows of an array that have been added before, bit by bit, so that an array needs equal
/// ones only once. It remembers one row for each of 256 values of a hash: of a few kinds it finds
/// nearly all, and where most rows differ it takes no more time or memory for that.
class RecentRows {
 public:
  /// The number of a row equal to this one among the rows of `all`, of the same length each, or -1.
  std::int32_t find(std::span<const double> row, std::span<const double> all) const {
    const std::int32_t number = numbers_[place_of(row)] - 1;
    const std::size_t begin = static_cast<std::size_t>(number) * row.size();
    if (number < 0 || begin + row.size() > all.size()) return -1;
    const auto same = [](double a, double b) {
      return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
    };
    return std::ranges::equal(row, all.subspan(begin, row.size()), same) ? number : -1;
  }
  /// A row has been added.
  void note(std::span<const double> row, std::int32_t number) {
    numbers_[place_of(row)] = number + 1;
  }

 private:
  static constexpr std::size_t kPlaces = 256;
  static std::size_t place_of(std::span<const double> row) {
    std::uint64_t hash = 0;
    for (const double value : row)
      hash = (std::rotl(hash, 23) ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15ULL;
    return static_cast<std::size_t>(hash >> 56);
  }
  std::array<std::int32_t, kPlaces> numbers_{};  // more by one, so that 0 is none
};

}  // namespace cairn
