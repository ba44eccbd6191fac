// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cell_box.hpp"
#include "evidence_grid.hpp"

namespace cairn::exploration {

/// What counts of hits and misses say of a cell.
struct CellModel {
  double hit = 0.9, miss = 0.7;                    ///< evidence of one [log odds]
  float limit = 4.2F;                              ///< most log odds, either way
  float free_below = 0.0F, occupied_above = 0.0F;  ///< [log odds]
  bool smooth = true;                              ///< unknown specks amid free cells are free
  double part_filled = 0.1;  ///< a wall fills a free cell in part if so many scans end in it
};

/// Makes a `FloorMap` of evidence, and keeps it up to date: it computes again only where evidence
/// has changed and what depends on that, and the map is, bit for bit, the one that a computation of
/// the whole gives.
class FloorClassifier {
 public:
  explicit FloorClassifier(const CellModel& model) : model_(model) {}

  /// `changed`: in which cells of the world counts may have changed since the last update.
  /// `blocked`: cells of the world that obstruct a body whatever the evidence.
  void update(const EvidenceGrid& grid, const CellBox& changed,
              std::vector<Eigen::Vector2i> blocked);
  const FloorMap& map() const { return map_; }

 private:
  void move_to(const EvidenceGrid& grid);
  CellBox whole() const { return {{0, 0}, {map_.frame.width, map_.frame.height}}; }
  void weigh(const EvidenceGrid& grid, const CellBox& box);
  void classify(const CellBox& box);
  bool mostly_free(int x, int y) const;
  CellState seen(int x, int y) const;
  void find_clearance(const CellBox& box);
  bool measure_clearance(const CellBox& box, int margin);
  void find_borders(const CellBox& box);
  void find_frontiers();
  std::vector<std::int32_t> border_cells() const;
  void measure(Frontier& frontier) const;

  CellModel model_;
  FloorMap map_;
  Eigen::Vector2i first_ = Eigen::Vector2i::Zero();  ///< cell (0, 0) of the map, in the world
  std::vector<CellState> seen_;  ///< by the evidence of each cell alone, without smoothing
  std::vector<std::uint8_t> part_filled_;  ///< cells that a wall fills in part, or wholly: 1
  std::vector<std::uint8_t> border_;       ///< free cells beside unknown ones: 1
  std::vector<std::int32_t> part_;        ///< of border cells, while frontiers are found; else −1
  std::vector<Eigen::Vector2i> blocked_;  ///< in the world
  float most_clearance_ = 0.0F;           ///< no clearance has been larger [m]
};

}  // namespace cairn::exploration
