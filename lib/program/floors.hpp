// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <boost/json/object.hpp>

#include "cairn/grid/grid.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/pose2.hpp"
#include "program/session.hpp"

namespace cairn::app {

// What commands do with floors (occupancy grids) in place of graphs.

/// Whether a name is that of a floor: a file with the ending of a grid format and not of a format
/// of graphs, or @KIND of a floor plan.
bool names_floor(const std::string& name, Session& session);

/// What to throw (input) where a file was refused as a graph: it may be the map of a floor.
Error no_graph(const std::string& file, const Error& refusal, Session& session);

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

struct FloorInfoOptions {
  double radius = 0.2;                         ///< of a robot's body [m]
  std::optional<double> start_x{}, start_y{};  ///< [m]

  static auto fields() {
    using O = FloorInfoOptions;
    constexpr double kAny = std::numeric_limits<double>::infinity();
    constexpr const char* kStart = "where the robot is, instead of the widest place";
    return OptionFields<O>()
        .real("radius", &O::radius, 0.0, 1000.0, "of a robot's body on a floor [m]")
        .placeholder("R")
        .real("start_x", &O::start_x, -kAny, kAny, kStart)
        .real("start_y", &O::start_y, -kAny, kAny, kStart)
        .placeholder("Y");
  }
};
/// `cairn info` of a floor: its size, what a robot reaches, where it leaks.
int run_floor_info(const std::string& name, const FloorInfoOptions& options, Session& session);

/// Whether KIND[:k=v] names a floor plan.
bool names_floor_plan(const std::string& kind, Session& session);
/// `cairn generate` of a floor plan.
int run_floor_generate(const std::string& kind, std::uint64_t seed, const std::string& output,
                       Session& session);

}  // namespace cairn::app
