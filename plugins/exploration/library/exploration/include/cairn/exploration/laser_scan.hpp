// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <numbers>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A planar lidar on the robot's centre, which looks along its x axis.
struct LidarModel {
  double aperture = std::numbers::pi;  ///< angle between the outermost beams [rad], up to 2π
  int beams = 181;
  double range = 8.0;   ///< [m] within which it sees anything
  double sigma = 0.01;  ///< standard deviation of a range [m]

  /// Angle between neighbouring beams [rad]: with a full circle the last beam is not the first.
  double step() const {
    const bool circle = aperture > 2.0 * std::numbers::pi - 1e-9;
    return beams < 2 ? 0.0 : aperture / (circle ? beams : beams - 1);
  }
  /// Of the first beam, in the robot's frame [rad]; the others follow counterclockwise.
  double first_angle() const { return -0.5 * step() * (beams - 1); }
};

/// Unit vectors along the beams, in the robot's frame.
CAIRN_API std::vector<Eigen::Vector2d> beam_directions(const LidarModel& lidar);

/// Ranges along beams that start at the robot's centre.
struct LaserScan {
  double first_angle = 0.0;  ///< of the first beam, in the robot's frame [rad], counterclockwise
  double angle_step = 0.0;   ///< between neighbouring beams [rad]
  double max_range = 0.0;    ///< [m]
  /// By beam [m]. `max_range` or more: nothing within it; NaN, or not above zero: no measurement.
  std::vector<float> ranges;

  double angle(std::size_t beam) const {
    return first_angle + angle_step * static_cast<double>(beam);
  }
};

/// Throws `Error` (input), beginning with `name`, for a scan without beams, one whose angles are
/// not finite or turn by more than 2π (and a millionth), or one whose `max_range` is not above
/// zero. Ranges may be anything.
CAIRN_API void check_scan(const LaserScan& scan, std::string_view name);
/// Of the beams, how many have measured something: an obstacle, or that there is none in range.
CAIRN_API std::size_t measured_beams(const LaserScan& scan);

/// Ability of a registration that matches laser scans: it is given them as they are taken.
class CAIRN_API ScanRegistration {
 public:
  static constexpr std::string_view kAbility = kScanRegistration;
  virtual ~ScanRegistration();
  /// The scan that was taken at a pose; called before the first match with it. After
  /// `Registration::pose_ended` with false it may be forgotten, that of the newest pose once the
  /// next pose has ended.
  virtual void take(Id pose, LaserScan scan) = 0;
};

}  // namespace cairn
