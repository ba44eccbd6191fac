// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "cairn/exploration/path_planner.hpp"

namespace cairn {

/// What it costs to drive to the end of a path over the cells where a body fits, if it could turn
/// in place: a metre costs one, and more where it lies away from the path. A search along curves
/// that counts so goes on where least is left (Dolgov et al. 2010), and so looks at few poses off
/// the way, also where the path is no short one. By steps to eight neighbours.
class PathCosts {
 public:
  /// `interrupt`: once it is true what is left is unknown; may be null.
  PathCosts(const PlannedPath& path, const FloorMap& map, double needed_clearance,
            const std::atomic<bool>* interrupt);

  /// Of a metre in a cell.
  double per_metre(std::size_t cell) const { return per_metre_[cell]; }
  /// From the middle of a cell to the end of the path; infinite: there is no way.
  double to_end(std::size_t cell) const { return to_end_[cell]; }

 private:
  void add_segment(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const GridFrame& frame);
  void spread(const Eigen::Vector2d& end, const FloorMap& map, double needed_clearance,
              const std::atomic<bool>* interrupt);

  std::vector<double> per_metre_, to_end_;
};

}  // namespace cairn
