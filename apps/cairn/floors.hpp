// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "session.hpp"

namespace cairn::app {

// What commands do with floors (occupancy grids) in place of graphs.

/// Whether a name is that of a floor: a file with the ending of a grid format and not of a format
/// of graphs, or @KIND of a floor plan.
bool names_floor(const std::string& name, Session& session);

struct FloorInfoOptions {
  double radius = 0.2;                         ///< of a robot's body [m]
  std::optional<double> start_x{}, start_y{};  ///< [m]
};
/// `cairn info` of a floor: its size, what a robot reaches, where it leaks.
int run_floor_info(const std::string& name, const FloorInfoOptions& options, Session& session);

/// Whether KIND[:k=v] names a floor plan.
bool names_floor_plan(const std::string& kind, Session& session);
/// `cairn generate` of a floor plan.
int run_floor_generate(const std::string& kind, std::uint64_t seed, const std::string& output,
                       Session& session);

}  // namespace cairn::app
