// SPDX-License-Identifier: BSD-3-Clause
#include "match_index.hpp"

#include <algorithm>

#include "cairn/planning/loop_closure_value.hpp"

namespace cairn {

MatchIndex::MatchIndex(std::span<const Pose2> poses, const Pose2& robot, const MatchModel& match)
    : match_(match) {
  Eigen::Vector2d low = robot.translation(), high = low;
  for (const Pose2& pose : poses) {
    low = low.cwiseMin(pose.translation());
    high = high.cwiseMax(pose.translation());
  }
  constexpr double kSmallest = 0.1;  // side of a bucket [m]
  buckets_.emplace(low, high, std::max(match.range, kSmallest));
  for (std::size_t k = 0; k + 1 < poses.size(); ++k) {
    const Pose2& pose = poses[k];
    if (can_match(pose, robot, match)) continue;
    older_.push_back({static_cast<int>(k), pose.x(), pose.y(), std::cos(pose.theta()),
                      std::sin(pose.theta()), pose.theta()});
    buckets_->add(pose.translation());
  }
}

}  // namespace cairn
