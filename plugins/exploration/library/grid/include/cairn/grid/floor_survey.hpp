// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

/// Where free floor ends without a wall: at unknown cells, or at the edge of the grid.
struct FloorLeak {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< the cell in the middle of it [m]
  double length = 0.0;                           ///< [m], of the free cells along it
  bool at_edge = false;                          ///< of the grid, at least in part
};

/// What a robot with a round body finds on a floor.
struct FloorSurvey {
  double free_area = 0.0, occupied_area = 0.0, unknown_area = 0.0;  ///< [m²]
  /// Where the robot is: as asked for, else the middle of the cell that is farthest from all that
  /// is not free.
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  double start_clearance = 0.0;         ///< from there to the nearest cell that is not free [m]
  double standing_area = 0.0;           ///< of the cells that the body's centre can reach [m²]
  double covered_area = 0.0;            ///< of the free cells that its body can cover [m²]
  std::vector<std::uint8_t> covered{};  ///< by cell of the grid: 1 if it is one of these
  /// Parts of the floor where the body fits as well, and that it cannot reach.
  int unreachable_parts = 0;
  double unreachable_area = 0.0;  ///< of the cells that a body's centre could be in there [m²]
  /// The largest of these, if it is larger than the one with the start: where in it a body's centre
  /// is nearest to the start, and the area of such places.
  std::optional<Eigen::Vector2d> larger_part{};
  double larger_area = 0.0;      ///< [m²]
  std::vector<FloorLeak> leaks;  ///< of the reachable floor, longest first
};

struct FloorSurveyOptions {
  double radius = 0.2;  ///< of the body [m]
  std::optional<Eigen::Vector2d> start{};
  CellThresholds thresholds{};
};

/// Finds what a robot reaches on a floor.
class CAIRN_API FloorSurveyor : public Component {
 public:
  static constexpr std::string_view kKind = "floor_surveyor";
  ~FloorSurveyor() override;

  /// The body's centre is in the middle of a cell. It fits there if no cell that is not free has
  /// its middle within the radius and half a cell; it covers the free cells whose middle is within
  /// that. What lies outside the grid is not free. Ways go over cells that share a side. Throws
  /// `Error` (input) if there is no free cell, if the body fits nowhere, or if it does not fit
  /// where it is to start, with the nearest place where it does.
  virtual FloorSurvey survey(const OccupancyGrid& grid, const FloorSurveyOptions& options) = 0;
};

}  // namespace cairn
