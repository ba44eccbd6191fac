// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/laser_scan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// A map beside the floor that it is of [m²]. Cells of the map are compared with the cell of the
/// floor in which their middle lies.
struct MapTruth {
  double floor = 0.0;  ///< free floor that hangs together with the start, over sides of cells
  double seen = 0.0;   ///< of that, what the map knows
  /// Of the floor that the robot's body can cover, the part that the map knows; none: which floor
  /// that is was not given.
  std::optional<double> reachable_seen{};
  double free_wrong = 0.0;      ///< free in the map, an obstacle of the floor
  double occupied_wrong = 0.0;  ///< occupied in the map; free on the floor, and not beside a wall
};

/// Compares a map with the floor. `alignment` takes points of the map's world to that of the floor;
/// `start` is a point of the floor [m]; `reachable`, if not empty: by cell of the floor, whether
/// the robot's body can cover it (`FloorSurvey::covered`).
CAIRN_API MapTruth compare_with_floor(const FloorMap& map, const OccupancyGrid& floor,
                                      const Pose2& alignment, const Eigen::Vector2d& start,
                                      std::span<const std::uint8_t> reachable = {});

/// Cells of the map that are free though an end point of a scan lies in them, each once [m²]: the
/// "map error" of the thesis (5.4.5) without knowledge of the truth.
CAIRN_API double contradicted_area(const FloorMap& map, std::span<const LaserScan> scans,
                                   std::span<const Pose2> poses);

/// By scan, the part of its end points that lie in an occupied cell or beside one: what a map that
/// is right explains of its own scans, all but people and glass. NaN without end points.
CAIRN_API std::vector<double> scan_agreement(const FloorMap& map, std::span<const LaserScan> scans,
                                             std::span<const Pose2> poses);

/// How well a map explains its own scans.
struct MapAgreement {
  double mean = 1.0;  ///< of all scans
  /// Of the `kAgreementScans` scans in a row that the map explains worst: where walls are doubled
  /// or smeared, as a wrong match leaves them, it is low, while the mean hardly changes.
  double least = 1.0;
  std::size_t first = 0;  ///< of these scans
};
inline constexpr std::size_t kAgreementScans = 20;
/// Below which `MapAgreement::least` is implausible: of 29 maps of two buildings those that were
/// right had 0.69 to 0.90, those with a room out of place 0.23 to 0.60.
inline constexpr double kPlausibleAgreement = 0.65;

/// Of the result of `scan_agreement`; scans without end points are left out.
CAIRN_API MapAgreement map_agreement(std::span<const double> scans);

}  // namespace cairn
