// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/typed/pose2.hpp"
#include "surface_scan.hpp"

namespace cairn::icp {

/// How one scan's points appear to the lidar of another.
struct Visibility {
  int agreeing = 0;  ///< where that lidar sees a surface
  int in_front = 0;  ///< of what it sees: it looked through the point, which contradicts the pose
  int behind = 0;    ///< what it sees: hidden, which proves neither
  int outside = 0;   ///< of its aperture or range, or where it measured nothing

  Visibility& operator+=(const Visibility& other) {
    agreeing += other.agreeing;
    in_front += other.in_front;
    behind += other.behind;
    outside += other.outside;
    return *this;
  }
  int seen() const { return agreeing + in_front + behind; }
  /// Part of the points within the other lidar's view that agree; 0 if there are none.
  double overlap() const { return seen() == 0 ? 0.0 : static_cast<double>(agreeing) / seen(); }
  /// Part of the points that are not hidden and are in front; 1 if there are none.
  double conflict() const {
    return agreeing + in_front == 0 ? 1.0 : static_cast<double>(in_front) / (agreeing + in_front);
  }
};

/// The points of `moving`, whose pose is `pose` in the frame of `reference`, as the reference's
/// lidar sees them. A point agrees if its range is between those of the two beams beside it, or
/// beyond them by no more than `tolerance` [m].
Visibility visibility(const SurfaceScan& reference, const SurfaceScan& moving, const Pose2& pose,
                      double tolerance);

/// Both scans, each as the other's lidar sees it.
Visibility mutual_visibility(const SurfaceScan& reference, const SurfaceScan& moving,
                             const Pose2& pose, double tolerance);

}  // namespace cairn::icp
