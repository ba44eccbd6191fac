// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/exploration/exploration.hpp"

namespace cairn::app {

// Options of `cairn explore` whose values are words such as "distance=250,steps=100". What is not
// given has its default. Both throw `Error` (usage) for other words and for what is no number above
// zero.

/// --until
ExplorationLimits limits_of(const std::string& words);
/// --match
MatchModel match_of(const std::string& words);

}  // namespace cairn::app
