// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <boost/json/object.hpp>

#include "cairn/grid/grid.hpp"
#include "cairn/program/session.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn::app {

// What commands do with floors (occupancy grids) in place of graphs.

/// A floor from a file or, as "@rooms:seed=3", generated.
OccupancyGrid load_floor(const std::string& name, Session& session);
/// Notes where a body on a floor cannot go though it would fit: doors are too narrow, or it starts
/// in a pocket. Returns what it can cover, `FloorSurvey::covered`; empty without the surveyor.
/// Throws `Error` (input) with the floor's name where it cannot start at all.
std::vector<std::uint8_t> note_narrow_ways(const std::string& name, const OccupancyGrid& floor,
                                           double radius, const std::optional<Pose2>& start,
                                           Session& session);
/// "10 m × 8 m, 200 × 160 cells of 0.05 m"
std::string size_text(const GridFrame& frame);
boost::json::object frame_json(const std::string& name, const GridFrame& frame);

/// Throws `Error` (usage, input) where a map cannot be written to that file, which `option` names.
void check_map_file(const std::string& file, const char* option, Session& session);

}  // namespace cairn::app
