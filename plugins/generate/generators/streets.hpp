// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "random.hpp"
#include "rigid.hpp"

namespace cairn::generate {

/// A world of straight streets that cross at right angles, and a robot that drives them in equal
/// steps. All positions are multiples of the step and all headings of a quarter turn, so that
/// places are met again exactly.
struct StreetWorld {
  double step = 1.0;            ///< between poses [m]
  std::vector<int> east_gaps;   ///< steps from one north-south street to the next, going east
  std::vector<int> north_gaps;  ///< steps from one east-west street to the next, going north
};

/// As many streets each way as make a path of `poses` pass every place about `visits` times.
int streets_for(std::int64_t poses, int block, double visits);

/// A walk that goes straight on at a crossing with probability 1/2 and turns either way with 1/4,
/// within the walls of the world and never turning back where it need not.
std::vector<Pose2> random_walk(const StreetWorld& world, std::int64_t poses, Random& random);

/// Errands: from crossing to crossing, each drawn anew, along one street and then along another.
std::vector<Pose2> errands(const StreetWorld& world, std::int64_t poses, Random& random);

}  // namespace cairn::generate
