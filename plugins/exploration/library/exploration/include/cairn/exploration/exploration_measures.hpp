// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/exploration/exploration.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields.hpp"

namespace cairn {

/// The numbers by which runs are compared: those of the thesis (5.3.3 and 5.4.5) and those that
/// need the truth, which are NaN where it is not known.
struct ExplorationMeasures {
  double distance = 0.0;  ///< driven [m]
  double motions = 0.0, decisions = 0.0;
  double coverage = 0.0;  ///< `FloorMap::coverage` [m²]
  double seen = 0.0;      ///< of the floor that hangs together with the start, what is known [m²]
  double reachable_seen = 0.0;  ///< part of what the robot's body can cover that is known
  /// (5.6) over a grid as large as that of the floor, whatever the size of the map's [nats·m²].
  double map_entropy = 0.0;
  double trajectory_entropy = 0.0;  ///< (5.13) [nats]
  double map_error = 0.0;           ///< `contradicted_area` [m²]
  double wrong = 0.0;               ///< `MapTruth`: cells wrongly free or wrongly occupied [m²]
  double loops = 0.0;               ///< loop closures in the graph
  double poses = 0.0;               ///< that are kept
  double collisions = 0.0;
  double ate = 0.0;           ///< absolute trajectory error, after rigid alignment [m]
  double ate_rotation = 0.0;  ///< [deg]
  double expected_ate = 0.0;  ///< by the covariances [m]
  /// Of deciding, estimating and matching scans, all but mapping and the simulation [s].
  double seconds = 0.0;
  double map_seconds = 0.0;      ///< of mapping: the thesis's "rendering" [s]
  double decide_seconds = 0.0;   ///< of all decisions [s]
  double decision_median = 0.0;  ///< of one decision [s]
  double decision_p95 = 0.0;     ///< that 95 % of the decisions do not exceed [s]
  double decision_max = 0.0;     ///< of the longest [s]

  CAIRN_API static ResultFields<ExplorationMeasures> fields();
};

/// What a measure is called, its unit and what it is, in the order of the struct.
CAIRN_API const std::vector<ResultField>& exploration_measures();
/// One of them. Precondition: `measure` is below how many there are.
CAIRN_API double value_of(const ExplorationMeasures& measures, std::size_t measure);
/// Whether it is of the clock, which differs between runs that are otherwise the same.
CAIRN_API bool is_time(const ResultField& measure);

/// (5.6) of a grid of `area` [m²], from the entropy of a smaller or larger one: cells that are
/// unknown have ln 2 nats each.
CAIRN_API double entropy_of_area(double entropy, double grid_area, double area);

/// `floor_area`: of the floor's grid, known or not [m²]; 0: not known, then of the map's own.
CAIRN_API ExplorationMeasures measures_of(const ExplorationResult& result, double floor_area);

/// The smallest of these that a part of them does not exceed; 0 of none.
CAIRN_API double quantile(std::span<const double> values, double part);

}  // namespace cairn
