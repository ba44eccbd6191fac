// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "cairn/io/random_numbers.hpp"

namespace cairn {

/// Random numbers for one purpose of one run: streams of one seed are independent of each other, so
/// that methods that are compared at one seed meet the same noise.
class RandomStream : public RandomNumbers {
 public:
  enum class Purpose : std::uint64_t { odometry = 1, lidar, explorer, start };

  RandomStream(std::uint64_t seed, Purpose purpose)
      : RandomNumbers(mixed(mixed(seed) + static_cast<std::uint64_t>(purpose))) {}
};

}  // namespace cairn
