// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/lie/so2.hpp"
#include "cairn/planning/point_buckets.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Poses of a graph by place, for the question with which of them a pose of a path can be matched.
/// The newest one is left out, and those that can be matched with where the robot is already: that
/// needs no path.
class MatchIndex {
 public:
  MatchIndex(std::span<const Pose2> poses, const Pose2& robot, const MatchModel& match);

  /// Calls `each(number)` for each pose in whose match area `newer` lies, in their order.
  template <class Each>
  void for_each(const Pose2& newer, Each each) {
    const double x = newer.x(), y = newer.y(), theta = newer.theta();
    buckets_->within(newer.translation(), std::numbers::sqrt2 * match_.range, near_);
    for (const int number : near_) {
      const Older& older = older_[static_cast<std::size_t>(number)];
      const double dx = x - older.x, dy = y - older.y;
      if (std::abs(older.cos * dx + older.sin * dy) > match_.range ||
          std::abs(older.cos * dy - older.sin * dx) > match_.range ||
          std::abs(wrap_angle(theta - older.theta)) > match_.angle)
        continue;
      each(older.number);
    }
  }

 private:
  struct Older {
    int number;
    double x, y, cos, sin, theta;
  };

  MatchModel match_;
  std::vector<Older> older_;
  std::optional<PointBuckets> buckets_;
  std::vector<int> near_;
};

}  // namespace cairn
