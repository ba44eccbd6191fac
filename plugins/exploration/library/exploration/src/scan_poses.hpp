// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/policy/pose_policy.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Where each scan was taken, by the latest estimate: at a pose that is kept, or at one that was
/// left out, which moves with the pose that was kept before it.
class ScanPoses {
 public:
  /// The newest pose, after the policy has ended it.
  void add(const PoseReport& report, PosePolicy& policy);
  /// Follows the estimate.
  void update(PosePolicy& policy);
  std::span<const Pose2> all() const { return poses_; }

 private:
  struct Anchor {
    Id pose;
    Pose2 relative;  ///< where the scan was taken, in the frame of that pose
  };

  std::vector<Anchor> anchors_;
  std::vector<Pose2> poses_;
};

/// The state of a pose in the plane.
Pose2 pose_in(Estimator& estimator, Id id);

}  // namespace cairn
