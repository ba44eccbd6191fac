// SPDX-License-Identifier: BSD-3-Clause
#include "run_progress.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

namespace cairn {
namespace {

/// So many motions in a row that move the robot by less than `kNoMotion`, and so many decisions in
/// a row that lead to no motion: then it is stuck.
constexpr int kMostIdle = 20;
constexpr int kMostEmptyDecisions = 3;
/// Paths in a row on which the robot would touch something before it has moved.
constexpr int kMostRefused = 60;
/// After so many it drives on one that is planned for the whole body all the same.
constexpr int kMostWideRefused = 30;
/// Collisions without a free motion in between.
constexpr int kMostCollisions = 10;
/// Of the way of one decision this part of `idle_distance` counts at most: on a large floor the way
/// to the next frontier alone may be longer than that.
constexpr double kMostOfOneWay = 0.2;

}  // namespace

void RunProgress::discover(const FloorMap& map, double driven) {
  if (!discovered_.grows(map)) return;
  idle_distance_ = 0.0;
  way_begin_ = useful_distance_ = driven;
}

void RunProgress::decide(double driven) {
  idle_distance_ += idle_way(driven);
  way_begin_ = driven;
}

void RunProgress::end_path(bool moved, bool refused) {
  empty_decisions_ = moved || refused ? 0 : empty_decisions_ + 1;
  refused_paths_ += refused;
}

void RunProgress::set_out(const Pose2& motion) {
  if (motion.translation().norm() > kNoMotion) refused_paths_ = 0;
}

void RunProgress::move(const MadeMotion& motion, bool backs_off, double radius) {
  const bool idle = std::max(motion.driven(), std::abs(motion.moved.theta())) < kNoMotion;
  idle_ = idle ? idle_ + 1 : 0;
  if (backs_off) return;
  if (motion.collided)
    ++collisions_;
  else if (motion.driven() > radius)
    collisions_ = 0;
}

/// What counts of the way since the newest decision, as driven without progress [m].
double RunProgress::idle_way(double driven) const {
  return std::min(driven - way_begin_, kMostOfOneWay * most_idle_);
}

std::optional<std::string> RunProgress::why_stuck(double driven) const {
  if (idle_distance_ + idle_way(driven) > most_idle_)
    return fmt::format("{:.0f} m were driven without finding more floor",
                       driven - useful_distance_);
  if (collisions_ >= kMostCollisions) return fmt::format("{} collisions in a row", kMostCollisions);
  if (idle_ >= kMostIdle) return fmt::format("{} motions in a row were stopped", kMostIdle);
  if (empty_decisions_ >= kMostEmptyDecisions)
    return fmt::format("{} decisions in a row led to no motion", kMostEmptyDecisions);
  return std::nullopt;
}

std::optional<std::string> RunProgress::why_refused() const {
  if (refused_paths_ < kMostRefused) return std::nullopt;
  return fmt::format("on {} paths in a row something is in the way at once", kMostRefused);
}

bool RunProgress::is_refused_often() const { return refused_paths_ >= kMostWideRefused; }

}  // namespace cairn
