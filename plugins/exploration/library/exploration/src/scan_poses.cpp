// SPDX-License-Identifier: BSD-3-Clause
#include "scan_poses.hpp"

#include <algorithm>

namespace cairn {

Pose2 pose_in(Estimator& estimator, Id id) { return Pose2::from_state(estimator.state(id)); }

void ScanPoses::add(const PoseReport& report, PosePolicy& policy) {
  const Pose2 newest = Pose2::from_state(policy.newest_state());
  const Id base = report.kept ? report.id : policy.kept().back();
  anchors_.push_back({base, pose_in(policy.estimator(), base).between(newest)});
  poses_.push_back(newest);
  // Scans of poses that have left the graph go on from one that is there.
  const std::vector<Id> removed = policy.removed();
  if (removed.empty()) return;
  for (std::size_t k = 0; k < anchors_.size(); ++k) {
    if (std::ranges::find(removed, anchors_[k].pose) == removed.end()) continue;
    anchors_[k] = {base, pose_in(policy.estimator(), base).between(poses_[k])};
  }
}

void ScanPoses::update(PosePolicy& policy) {
  Estimator& estimator = policy.estimator();
  for (std::size_t k = 0; k < anchors_.size(); ++k)
    poses_[k] = pose_in(estimator, anchors_[k].pose) * anchors_[k].relative;
}

}  // namespace cairn
