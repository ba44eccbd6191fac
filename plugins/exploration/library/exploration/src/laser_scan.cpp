// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/laser_scan.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {

ScanRegistration::~ScanRegistration() = default;

std::vector<Eigen::Vector2d> beam_directions(const LidarModel& lidar) {
  std::vector<Eigen::Vector2d> directions;
  directions.reserve(static_cast<std::size_t>(lidar.beams));
  for (int beam = 0; beam < lidar.beams; ++beam) {
    const double angle = lidar.first_angle() + lidar.step() * beam;
    directions.emplace_back(std::cos(angle), std::sin(angle));
  }
  return directions;
}

void check_scan(const LaserScan& scan, std::string_view name) {
  const auto refuse = [&](const std::string& why) {
    throw Error(ErrorCode::input, fmt::format("{}: {}", name, why));
  };
  if (scan.ranges.empty()) refuse("a scan without beams; a lidar needs one at least");
  constexpr double kMostTurn = 2.0 * std::numbers::pi + 1e-6;
  const double turn = scan.angle_step * static_cast<double>(scan.ranges.size() - 1);
  if (!(std::abs(turn) <= kMostTurn) || !std::isfinite(scan.first_angle)) {
    refuse(
        fmt::format("a scan from the angle {} on over {} rad, expected finite angles that turn "
                    "by at most 2π",
                    scan.first_angle, turn));
  }
  if (!(scan.max_range > 0.0) || !std::isfinite(scan.max_range)) {
    refuse(fmt::format("a scan with a largest range of {} m, expected a finite number above zero",
                       scan.max_range));
  }
}

std::size_t measured_beams(const LaserScan& scan) {
  return static_cast<std::size_t>(
      std::ranges::count_if(scan.ranges, [](float range) { return range > 0.0F; }));
}

}  // namespace cairn
