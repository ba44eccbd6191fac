// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/typed/pose2.hpp"
#include "support/sampling.hpp"

namespace cairn::test {

/// Two scans of one floor, and what is guessed of their relative pose.
struct ScanPair {
  LaserScan earlier, later;
  Pose2 truth;  ///< of `later` in the frame of `earlier`
  Pose2 guess;
};

/// The size of the boxes in which relative poses and errors of guesses are drawn.
struct PairRange {
  double position = 1.0;  ///< each axis [m]
  double angle = 0.35;    ///< [rad]
};

/// A round person in view of the lidar, 1 to 2.5 m from it: stands anywhere that some beams reach.
/// False: there is no such place.
bool put_person_in(LaserScan& scan, double width, double sigma, Sampler& random);

/// Ranges that are too long by `bias`, and are measured in steps, as cheap lidars do [m].
void distort(LaserScan& scan, double bias, double step);

/// Draws pairs of scans on a floor: the first pose anywhere that is at least 0.25 m from what is
/// not free, with any heading; the second near it, with a line of sight between them.
class ScanPairs {
 public:
  ScanPairs(const OccupancyGrid& floor, std::uint64_t seed);

  /// `range` is that of the relative poses, `off` that of the guesses' errors.
  ScanPair draw(const LidarModel& lidar, const PairRange& range, const PairRange& off);
  LaserScan scan(const Pose2& from, const LidarModel& lidar);

 private:
  bool is_clear(const Eigen::Vector2d& at) const;
  double gaussian();

  GridFrame frame_;
  RayCaster caster_;
  std::vector<bool> clear_;
  std::vector<std::size_t> standing_;
  Sampler random_;
};

}  // namespace cairn::test
