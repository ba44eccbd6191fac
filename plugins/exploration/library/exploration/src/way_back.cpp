// SPDX-License-Identifier: BSD-3-Clause
#include "way_back.hpp"

#include <utility>

namespace cairn {

PlannedPath WayBack::take(const ScanSlam& slam, double radius) {
  constexpr double kLength = 1.0;  // [m]
  Pose2 at = slam.pose();
  PlannedPath path{.points = {at.translation()}};
  double way = 1.0;
  while (!scans_.empty() && path.length < kLength) {
    const Pose2 from = slam.poses()[scans_.back()];
    scans_.pop_back();
    const Pose2 motion = from.between(at);
    const double back = motion.x() < 0.0 ? 1.0 : -1.0;
    if (std::exchange(way, back) != back) path.cusps.push_back(path.points.size() - 1);
    constexpr int kParts = 4;
    for (int part = kParts; part-- > 0;)
      path.points.push_back(from.retract(motion.log() * (double(part) / kParts)).translation());
    path.length += motion.translation().norm();
    at = from;
  }
  if (path.length >= radius) return path;
  const Eigen::Vector2d behind = slam.pose() * Point2(-radius, 0.0);
  return {.points = {slam.pose().translation(), behind}, .length = radius, .cusps = {0}};
}

}  // namespace cairn
