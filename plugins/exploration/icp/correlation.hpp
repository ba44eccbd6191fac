// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cairn/typed/pose2.hpp"
#include "surface_scan.hpp"

namespace cairn::icp {

/// Poses around a guess: those whose position differs by at most x and y [m] along the axes of the
/// reference scan, and whose orientation differs by at most `angle` [rad].
struct SearchWindow {
  double x = 1.0, y = 1.0;
  double angle = 0.35;
};

/// A local maximum of the correlation.
struct Candidate {
  Pose2 pose;
  double score = 0.0;  ///< mean likelihood of the points, 0 to 1
};

/// Correlative scan matching (Olson, Real-time correlative scan matching, ICRA 2009): the
/// likelihood of every pose of a window, in steps of a cell and of an angle, by a table of the
/// likelihood of a point around the reference's surfaces. A whole row of positions is added up at
/// a time, so that all of the window costs less than a millisecond and nothing needs to be bounded.
class Correlation {
 public:
  Correlation(const SurfaceScan& reference, const SearchWindow& window);

  /// The local maxima around a guess of the moving scan's pose, the best first; two of them are
  /// some cells or some steps of the angle apart.
  std::vector<Candidate> search(const SurfaceScan& moving, const Pose2& guess) const;

 private:
  void rasterise(const SurfaceScan& reference);
  void stamp(const Eigen::Vector2d& at, const std::vector<double>& likelihood);
  /// Adds the likelihood of all positions of the window for the points turned by `angle`.
  void add_scores(std::span<const Eigen::Vector2d> points, const Eigen::Vector2d& position,
                  double angle, std::uint16_t* scores) const;

  SearchWindow window_;
  int reach_x_, reach_y_, turns_;  ///< steps to either side
  int row_;                        ///< positions per row of scores, a multiple of what is added
  int width_ = 0, height_ = 0;     ///< of the table [cells]
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  ///< of the table [m]
  std::vector<std::uint8_t> table_;
};

}  // namespace cairn::icp
