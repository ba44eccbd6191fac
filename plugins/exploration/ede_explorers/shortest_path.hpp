// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/configuration_space.hpp"
#include "ede_goals.hpp"

namespace cairn::exploration {

/// A path from where the robot is along poses, straightened; at its end the robot has the heading
/// of the last one.
PlannedPath path_along(const Situation& situation, const ConfigurationSpace& space,
                       std::span<const Pose2> poses);

/// The shortest path over the cells of the space to a configuration that is reachable.
PlannedPath shortest_path(const Situation& situation, const ReachableField& at,
                          std::size_t configuration);

/// The reachable configuration with the least E below zero to which the path has at least `length`
/// [m]: what can be decided at once, when the time for a decision is over. None: there is none.
std::optional<std::size_t> best_beyond(const ReachableField& at, double length);

}  // namespace cairn::exploration
