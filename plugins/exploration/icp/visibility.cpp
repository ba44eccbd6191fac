// SPDX-License-Identifier: BSD-3-Clause
#include "visibility.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>

namespace cairn::icp {
namespace {

using Eigen::Vector2d;

/// The least and largest range of the beams beside a bearing.
struct Interval {
  double low, high;
};

/// Nothing if the bearing is outside of the aperture, or neither beam measured anything.
std::optional<Interval> ranges_at(const LaserScan& scan, double bearing) {
  const double count = static_cast<double>(scan.ranges.size());
  if (scan.angle_step == 0.0) return std::nullopt;
  double beam = (bearing - scan.first_angle) / scan.angle_step;
  const double circle = 2.0 * std::numbers::pi / std::abs(scan.angle_step);
  beam -= circle * std::floor((beam + 0.5) / circle);  // −½ or more
  if (!(beam <= count - 0.5)) return std::nullopt;
  const double below = std::floor(beam);
  Interval interval{std::numeric_limits<double>::infinity(), -1.0};
  for (const double k : {below, below + 1.0}) {
    if (k < 0.0 || k >= count) continue;
    const double range = scan.ranges[static_cast<std::size_t>(k)];
    if (std::isnan(range)) continue;
    interval = {std::min(interval.low, range), std::max(interval.high, range)};
  }
  if (interval.high < 0.0) return std::nullopt;
  return interval;
}

}  // namespace

Visibility visibility(const SurfaceScan& reference, const SurfaceScan& moving, const Pose2& pose,
                      double tolerance) {
  const LaserScan& scan = reference.scan();
  const Eigen::Matrix2d R = pose.rotation().matrix();
  const Vector2d t = pose.translation();
  Visibility seen;
  for (const Vector2d& point : moving.points()) {
    const Vector2d at = R * point + t;
    const double range = at.norm();
    const auto interval = ranges_at(scan, std::atan2(at.y(), at.x()));
    if (!interval || range > scan.max_range - tolerance) {
      ++seen.outside;
    } else if (range < interval->low - tolerance) {
      ++seen.in_front;
    } else if (range > interval->high + tolerance) {
      ++seen.behind;
    } else {
      ++seen.agreeing;
    }
  }
  return seen;
}

Visibility mutual_visibility(const SurfaceScan& reference, const SurfaceScan& moving,
                             const Pose2& pose, double tolerance) {
  Visibility both = visibility(reference, moving, pose, tolerance);
  both += visibility(moving, reference, pose.inverse(), tolerance);
  return both;
}

}  // namespace cairn::icp
