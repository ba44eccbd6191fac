// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/exploration/exploration.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::app {

// Options of `cairn explore` whose values are words such as "distance=250,steps=100". What is not
// given has its default. Both throw `Error` (usage) for other words and for what is no number above
// zero.

/// --until
ExplorationLimits limits_of(const std::string& words);
/// --match
MatchModel match_of(const std::string& words);

/// Throws `Error` (usage) for the name of a motion in place of that of a world.
void check_world(std::string_view name, const Registry& registry);

/// Throws `Error` (usage) for an option of the world that `--lidar` or `--odometry` is not for, and
/// names what is; options of worlds of other plugins may be anything.
void check_part_words(const std::string& words, std::string_view option);

}  // namespace cairn::app
