// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/grid/grid.hpp"
#include "cell_box.hpp"

namespace cairn::exploration {

/// In how many scans a cell was passed by a beam, and in how many one ended in it.
struct Evidence {
  std::int32_t misses = 0, hits = 0;
};

/// Where a beam ends, in cells from the world's origin, and whether at an obstacle.
struct BeamEnd {
  Eigen::Vector2d at;
  bool hit;

  Eigen::Vector2i cell() const { return at.array().floor().cast<int>(); }
};

/// A grid that grows with what is added to it. Its cells stand on multiples of their side: cell
/// (0, 0) of the world has the world's origin as its lower left corner. Counts are integers, so
/// that taking out what was added leaves no trace.
class EvidenceGrid {
 public:
  explicit EvidenceGrid(double resolution) { frame_.resolution = resolution; }

  const GridFrame& frame() const { return frame_; }
  /// By `GridFrame::index`.
  const std::vector<Evidence>& evidence() const { return evidence_; }
  /// Cell (0, 0) of the frame, in cells of the world.
  const Eigen::Vector2i& first() const { return first_; }
  CellBox world_box() const {
    return {first_, first_ + Eigen::Vector2i(frame_.width, frame_.height)};
  }

  /// Makes sure that a box [m] is on it. Throws `Error` (input) where it would be too large.
  void cover(const Eigen::Vector2d& low, const Eigen::Vector2d& high);
  /// Adds (1) or takes out (−1) a scan from a point, in cells of the world: each cell counts once,
  /// and one in which a beam ends is not passed. What it concerns must be covered.
  void count(const Eigen::Vector2d& from, const std::vector<BeamEnd>& ends, int change);
  /// Takes out everything.
  void clear();
  /// In which cells of the world counts may have changed since this was asked last.
  CellBox take_changed() { return std::exchange(changed_, {}); }

 private:
  Evidence* unmarked(int world_x, int world_y);
  void grow(const Eigen::Vector2i& first, const Eigen::Vector2i& last);

  GridFrame frame_;
  Eigen::Vector2i first_ = Eigen::Vector2i::Zero();
  std::vector<Evidence> evidence_;
  std::vector<std::uint32_t> marked_;  ///< the last scan that has marked the cell
  std::uint32_t scan_ = 0;
  CellBox changed_;
};

}  // namespace cairn::exploration
