// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>

#include "cairn/graph/graph.hpp"
#include "cairn/io/random_numbers.hpp"

namespace cairn::registration {

/// Random numbers of one pair of poses: the same in either order of the two, whenever they are
/// asked for, and unrelated to those of any other pair.
class PairRandom : public RandomNumbers {
 public:
  PairRandom(std::uint64_t seed, Id a, Id b)
      : RandomNumbers(mixed(mixed(mixed(seed) + static_cast<std::uint64_t>(std::min(a, b))) +
                            static_cast<std::uint64_t>(std::max(a, b)))) {}
};

}  // namespace cairn::registration
