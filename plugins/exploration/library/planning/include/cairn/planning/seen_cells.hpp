// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/laser_scan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Some cells of a grid, as bits of a box of it: rows `first_row` …, 64 columns to a word.
struct CellWindow {
  int first_row = 0, first_word = 0;
  int rows = 0, words = 0;          ///< words per row
  std::vector<std::uint64_t> bits;  ///< row by row; empty: no cell

  bool empty() const { return bits.empty(); }
};

/// A set of cells of a grid, as bits.
class CAIRN_API CellSet {
 public:
  CellSet() = default;
  /// An empty set of cells of a grid with so many rows of so many words of 64 bits.
  CellSet(int rows, int words_per_row);

  std::size_t count() const { return count_; }
  bool contains(int x, int y) const;
  /// How many cells of a window are not in the set.
  std::size_t missing(const CellWindow& window) const;
  void add(const CellWindow& window);

 private:
  template <class Visit>
  void for_each_word(const CellWindow& window, Visit&& visit) const;

  int words_per_row_ = 0;
  std::size_t count_ = 0;
  std::vector<std::uint64_t> bits_;
};

/// Which unknown cells a lidar is expected to discover from a pose (thesis, 5.4.3): those that its
/// beams enter before they meet a known obstacle, with what is unknown taken as free, up to a
/// range that is simulated. That range is between caution and the sensor's own.
///
/// Beams are those of the lidar model, and cells those of exact traversal, so that where the floor
/// is as expected a scan discovers these and no others. Cells beyond the map are unknown. Over
/// known floor beams are followed by `RayCaster`; from the first unknown cell on they go cell by
/// cell.
///
///     SeenCells seen(map, robot.lidar, 4.0);
///     CellSet path = seen.none();
///     path.add(seen.look(poses));
///     double change = seen.entropy_change(path.count());   // [nats·m²]
class CAIRN_API SeenCells {
 public:
  /// `range` [m]; time and bits as the map has cells, and a margin of the range around it.
  SeenCells(const FloorMap& map, const LidarModel& lidar, double range);

  /// From here on the cells of these points [m] do not count as unknown.
  void leave_out(std::span<const Eigen::Vector2d> points);
  /// No cell.
  CellSet none() const { return {frame_.height, words_}; }
  /// The unknown cells that are seen from any of these poses; none from those beside the map.
  CellWindow look(std::span<const Pose2> poses) const;
  /// The middles of cells of a set [m].
  std::vector<Eigen::Vector2d> middles(const CellSet& cells) const;
  /// What discovering so many cells does to the map's entropy, −l² ln 2 for each, with l the
  /// cell's side [nats·m²] (thesis, 5.6).
  double entropy_change(std::size_t cells) const;
  /// The grid that the sets refer to: the map's with a margin.
  const GridFrame& frame() const { return frame_; }

 private:
  void find_viewpoints();
  void cast(const Pose2& at, std::span<RayHit> hits, CellWindow& seen) const;
  void mark(const Eigen::Vector2d& from, double turn, std::span<const RayHit> hits,
            CellWindow& seen) const;
  CellWindow window_around(std::span<const Pose2> poses) const;

  GridFrame frame_;
  int words_ = 0;                                   ///< per row
  double reach_ = 0.0;                              ///< the range [m]
  double range_ = 0.0;                              ///< the same in cells
  std::vector<std::uint64_t> unknown_, obstacles_;  ///< bits by cell
  /// Cells from which an unknown one may be seen, by the number of cells on the way; bits by cell.
  std::vector<std::uint64_t> viewpoints_;
  std::vector<Eigen::Vector2d> beams_;  ///< directions in the robot's frame
  std::optional<RayCaster> floor_;      ///< what is known to be free
};

}  // namespace cairn
