// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn::test {

/// Straight walls, at which scans are exact.
struct Walls {
  struct Segment {
    Eigen::Vector2d from, to;
  };
  std::vector<Segment> segments;

  /// Adds a closed polygon.
  Walls& polygon(const std::vector<Eigen::Vector2d>& corners);
  /// Distance to the nearest wall along a direction [m]; infinite if there is none.
  double range(const Eigen::Vector2d& from, double angle) const;
  /// Without noise.
  LaserScan scan(const Pose2& from, const LidarModel& lidar = {}) const;
};

/// 6 m by 4 m with a pillar, a recess and a slanted wall: no two places look alike.
Walls furnished_room();
/// 60 m long along x and 2 m wide, closed far beyond the range of the lidar.
Walls corridor();

/// The same scan with normal noise of that standard deviation [m], by a seed.
LaserScan with_noise(LaserScan scan, double sigma, unsigned seed);

}  // namespace cairn::test
