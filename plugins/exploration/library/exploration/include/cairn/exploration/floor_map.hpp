// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// A beam ends at the surface of an obstacle, whose cell lies behind it: this far, in cells.
inline constexpr double kSurfaceInset = 0.25;

/// Free cells beside unknown ones that hang together: where the known floor may go on.
struct Frontier {
  std::vector<std::int32_t> cells;  ///< by `GridFrame::index`
  double length = 0.0;              ///< the cell's side times their number [m]
  /// The middle of the one of them that is nearest to their centroid [m].
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
};

/// The map of a floor, as far as it has been seen.
struct CAIRN_API FloorMap {
  GridFrame frame;
  /// ln(p / (1 − p)), p the probability of being occupied; 0: unknown (thesis, 5.1 and 5.2).
  std::vector<float> log_odds;
  std::vector<CellState> cells;
  /// From the middle of a cell to that of the nearest one that is not free, or in which a beam of
  /// the newest scan ends near the robot [m]; what lies outside the grid is not free.
  std::vector<float> clearance;
  /// The same, but no farther than to a free cell in which some beams end: a wall that fills it in
  /// part. Bodies fit through doors by `clearance`; by this, paths that have room avoid walls. Of
  /// another size: this mapper has none.
  std::vector<float> caution;
  std::vector<Frontier> frontiers;  ///< longest first

  bool has_caution() const { return caution.size() == clearance.size(); }
  std::size_t known_cells() const;
  /// Of the cells that are free or occupied [m²].
  double coverage() const { return static_cast<double>(known_cells()) * frame.cell_area(); }
  /// −l² Σ (p ln p + (1 − p) ln(1 − p)) over all cells, l their side [nats·m²] (thesis, 5.6, with
  /// the sign that it lacks there). It depends on how many unknown cells the grid has.
  double entropy() const;
  /// p in per cent, or `kUnknownCell` where the cell is neither free nor occupied.
  OccupancyGrid occupancy() const;
};

/// Builds the map of a floor from scans and where they were taken.
class CAIRN_API Mapper : public Component {
 public:
  static constexpr std::string_view kKind = "mapper";
  ~Mapper() override;

  /// Adds a scan; scans are numbered in this order. Throws `Error` (input) for a pose that is not
  /// finite, or one that is too far away for a grid of 10⁸ cells.
  virtual void add(const Pose2& at, LaserScan scan) = 0;
  /// The poses of all scans: if one has moved by more than rounding matters, the map is made anew.
  /// Returns whether it was.
  virtual bool move(std::span<const Pose2> poses) = 0;
  /// The map, good until the next call.
  virtual const FloorMap& map() = 0;
  virtual void reset() = 0;
};

}  // namespace cairn
