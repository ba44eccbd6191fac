// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/laser_scan.hpp"
#include "cairn/planning/configuration_space.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What a cell is to a beam that looks for frontiers: `open` lets it pass, `frontier` is what it
/// discovers, `opaque` ends it.
enum class BeamCell : std::uint8_t { open, frontier, opaque };

/// By cell: those of the map's frontiers, the other free cells, and all others, which are opaque.
CAIRN_API std::vector<BeamCell> beam_cells(const FloorMap& map);

/// A frontier cell that a beam meets.
struct SeenFrontier {
  std::int32_t cell = 0;  ///< by `GridFrame::index`
  double part = 0.0;      ///< min(1, r tan β / l): of the beams that meet this cell, one's share
};

/// How many frontier cells a lidar sees from each free configuration: the "map entropy decrease
/// grid" of the thesis (5.3.1), before it is multiplied by what a cell is worth.
///
/// For each of n directions, one sweep over the map finds by cell the nearest one that is not open.
/// It passes from each cell to the next one along a line that is sheared: a row (or column) at a
/// time, shifted by the rounded slope, so that a beam is off by less than one cell and one step
/// costs one addition. Between two cells that touch at a corner a beam passes only where one of the
/// two cells beside the corner is open. A frontier at the distance r, within the lidar's range,
/// counts min(1, r tan β / l), β the angle between directions and l the side of a cell, since about
/// l / (r tan β) beams meet it. Orientations add up the directions within the lidar's aperture: by
/// sums over all directions before the first of them, and before the last, of which each is the
/// difference.
///
/// Here the thesis convolves, with weights along the direction that fall fast enough for the
/// nearest cell to outvote all others, and counts all frontiers along it, hidden ones too.
class CAIRN_API FrontierView {
 public:
  /// `cells`: as `beam_cells`. One counter of 4 bytes per configuration. Throws `Error` (usage) for
  /// less than 4 or more than 2000 directions, or cells of another number than the map's.
  FrontierView(const ConfigurationSpace& space, std::span<const BeamCell> cells,
               const LidarModel& lidar, int directions);

  /// Frontier cells seen from a configuration, by `ConfigurationSpace::index`.
  double seen(std::size_t configuration) const { return counts_[configuration] * kUnit; }

 private:
  static constexpr double kUnit = 1.0 / (1 << 20);
  std::vector<std::int32_t> counts_;
};

/// The frontier cells that `FrontierView` counts at one configuration, by direction: the sum of
/// their parts is `seen`.
CAIRN_API std::vector<SeenFrontier> frontiers_seen_from(const ConfigurationSpace& space,
                                                        std::span<const BeamCell> cells,
                                                        const LidarModel& lidar, int directions,
                                                        std::size_t configuration);

}  // namespace cairn
