// SPDX-License-Identifier: BSD-3-Clause
#include "frontier_goals.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include <fmt/format.h>

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

/// A robot that comes no nearer to a frontier has no path to it [m].
constexpr double kNear = 2.0;
/// A path to a pose may end so far from it [m].
constexpr double kNearPose = 0.5;
/// A frontier is there still if a cell of one is so near to where its middle was [m].
constexpr double kStillThere = 0.5;
/// After so many times in vain clearly more must be known around a frontier before it is tried
/// again; before, anything has to change there.
constexpr int kInVain = 2;
/// A robot has come nearer to a goal if the path is shorter by this [m].
constexpr double kNearer = 0.5;
/// A robot that is elsewhere by less [m], with another heading by more [rad], has only turned: the
/// scan with which it turned may have closed the way, and another heading may open it. And one that
/// has not set out through a gap has seen something in its way, which the next path avoids.
constexpr double kMoved = 0.05;
constexpr int kStayed = 1, kDriven = 4;
/// So often a goal may be chosen without coming nearer: eight times, and through a gap that may be
/// too narrow once, since the robot may touch walls there, or four times if it has not set out.
constexpr int kMostWide = 8 * kDriven, kMostNarrow = kDriven;
/// So many gaps in a row that have proved too narrow: then no more are tried.
constexpr int kMostNarrowFailures = 6;
/// A robot that has moved by this looks around anew [m].
constexpr double kElsewhere = 0.5;
/// A robot that can't turn in place backs so often in a row instead of looking around.
constexpr int kMostBacks = 8;
/// Between the cells of a frontier that are tried as goals [m].
constexpr double kSpacing = 0.5;

}  // namespace

void FrontierGoals::begin() {
  given_up_.clear();
  attempted_.clear();
  attempt_.reset();
  narrow_failures_ = 0;
  looked_around_ = 0.0;
  looked_at_.reset();
  backed_ = 0;
}

void FrontierGoals::start(const Situation& situation) {
  situation_ = &situation;
  narrow_radius_ = 0.0;
  settle_attempt();
  planner_->start(situation.map, situation.pose.translation(), situation.robot.radius);
}

bool FrontierGoals::start_through_gaps() {
  const Situation& situation = *situation_;
  if (narrow_failures_ >= kMostNarrowFailures) {
    if (situation.poses.empty()) return false;
    const Pose2 first = Pose2::from_state(situation.estimator.state(situation.poses.front()));
    if (planner_->path_to(first.translation(), kNearPose)) return false;
  }
  narrow_radius_ = narrow_radius(situation.robot.radius, situation.map.frame);
  planner_->start(situation.map, situation.pose.translation(), narrow_radius_);
  return true;
}

std::vector<Candidate> FrontierGoals::candidates(double least) {
  std::vector<Candidate> found;
  unreachable_ = 0;
  longest_unreachable_ = 0.0;
  for (const Frontier& frontier : situation_->map.frontiers) {
    if (frontier.length < least || situation_->interrupted()) break;  // longest first
    std::optional<PlannedPath> path = path_to(frontier);
    if (path) {
      const double length = path->length;
      found.push_back(
          {std::move(*path), length, fmt::format("a frontier of {:.1f} m", frontier.length)});
    } else {
      ++unreachable_;
      longest_unreachable_ = std::max(longest_unreachable_, frontier.length);
    }
  }
  return found;
}

std::optional<PlannedPath> FrontierGoals::look_around() {
  const RobotModel& robot = situation_->robot;
  if (unreachable_ == 0) return std::nullopt;
  const Vector2d here = situation_->pose.translation();
  if (robot.motion == MotionModel::dubins) {
    if (backed_ == kMostBacks) return std::nullopt;
    ++backed_;
    return PlannedPath{.points = {here, situation_->pose * Point2(-robot.step, 0.0)},
                       .length = robot.step,
                       .cusps = {0}};
  }
  if (!looked_at_ || (here - *looked_at_).norm() > kElsewhere) {
    looked_at_ = here;
    looked_around_ = 0.0;
  }
  if (looked_around_ >= 2.0 * std::numbers::pi) return std::nullopt;
  looked_around_ += robot.turn;
  PlannedPath path;
  path.look_at =
      (situation_->pose * Pose2(0.0, 0.0, robot.turn)).transform_from(Vector2d(1.0, 0.0));
  return path;
}

std::optional<PlannedPath> FrontierGoals::path_to(const Pose2& pose) {
  std::optional<PlannedPath> path = planner_->path_to(pose.translation(), kNearPose);
  if (!path) return path;
  const Vector2d end = path->points.empty() ? pose.translation() : path->points.back();
  path->look_at = end + Vector2d(std::cos(pose.theta()), std::sin(pose.theta()));
  path->radius = narrow_radius_;
  if (!moves(*path)) return std::nullopt;
  return path;
}

std::optional<PlannedPath> FrontierGoals::path_to(const Frontier& frontier) {
  std::optional<PlannedPath> best = path_to(frontier.middle);
  if (best) return best;
  // A long one may be reached elsewhere.
  const GridFrame& frame = situation_->map.frame;
  const auto stride = static_cast<std::size_t>(std::max(1.0, kSpacing / frame.resolution));
  for (std::size_t k = stride / 2; k < frontier.cells.size(); k += stride) {
    if (situation_->interrupted()) break;
    const std::int32_t cell = frontier.cells[k];
    auto path = path_to(frame.centre(cell % frame.width, cell / frame.width));
    if (path && (!best || path->length < best->length)) best = std::move(path);
  }
  return best;
}

std::optional<PlannedPath> FrontierGoals::path_to(const Vector2d& goal) {
  if (is_given_up(goal)) return std::nullopt;
  std::optional<PlannedPath> path = planner_->path_to(goal, kNear);
  if (!path || comes_no_nearer(goal, path->length)) return std::nullopt;
  path->radius = narrow_radius_;
  if (moves(*path)) return path;
  give_up(goal);
  return std::nullopt;
}

bool FrontierGoals::is_there(const FloorMap& map, const Vector2d& middle) {
  const auto near = [&](std::int32_t cell) {
    const Vector2d point = map.frame.centre(cell % map.frame.width, cell / map.frame.width);
    return (point - middle).norm() < kStillThere;
  };
  return std::ranges::any_of(map.frontiers, [&](const Frontier& frontier) {
    return std::ranges::any_of(frontier.cells, near);
  });
}

bool FrontierGoals::moves(const PlannedPath& path) const {
  std::size_t passed = 0;
  return next_motion(situation_->pose, path, situation_->robot, passed).has_value();
}

void FrontierGoals::chosen(const PlannedPath& path) {
  backed_ = 0;
  const FloorMap& map = situation_->map;
  if (!path.look_at || !is_there(map, *path.look_at)) return;
  attempt_ = Attempt{.goal = KnownSurroundings(map, *path.look_at),
                     .length = path.length,
                     .from = situation_->pose,
                     .narrow = path.radius > 0.0};
}

/// What has come of the last attempt.
void FrontierGoals::settle_attempt() {
  const FloorMap& map = situation_->map;
  std::erase_if(attempted_, [&](const Attempted& other) { return other.goal.more_in(map); });
  const std::optional<Attempt> attempt = std::exchange(attempt_, std::nullopt);
  if (!attempt) return;
  const bool succeeded = attempt->goal.more_in(map);
  if (succeeded) {
    if (attempt->narrow) narrow_failures_ = 0;
    return;
  }
  const Pose2 motion = attempt->from.between(situation_->pose);
  const bool stayed = motion.translation().norm() < kMoved &&
                      (attempt->narrow || std::abs(motion.theta()) > kMoved);
  auto known = std::ranges::find_if(attempted_, [&](const Attempted& other) {
    return (other.goal.at() - attempt->goal.at()).norm() < kStillThere;
  });
  if (known == attempted_.end()) {
    attempted_.push_back({attempt->goal, attempt->length});
    known = std::prev(attempted_.end());
  } else if (attempt->length < known->length - kNearer) {
    *known = {attempt->goal, attempt->length};
  }
  (attempt->narrow ? known->narrow : known->wide) += stayed ? kStayed : kDriven;
  if (attempt->narrow && known->narrow >= kMostNarrow) ++narrow_failures_;
}

bool FrontierGoals::comes_no_nearer(const Vector2d& goal, double length) const {
  return std::ranges::any_of(attempted_, [&](const Attempted& other) {
    const bool in_vain =
        other.wide >= kMostWide || (narrow_radius_ > 0.0 && other.narrow >= kMostNarrow);
    return in_vain && length >= other.length - kNearer &&
           (other.goal.at() - goal).norm() < kStillThere;
  });
}

void FrontierGoals::give_up(const Vector2d& goal) {
  const FloorMap& map = situation_->map;
  const auto distance = [&](const GivenUp& other) { return (other.goal.at() - goal).norm(); };
  const auto again = std::ranges::min_element(given_up_, {}, distance);
  if (again == given_up_.end() || distance(*again) >= kStillThere ||
      again->goal.same_as(map)) {  // another one, or another cell of the same
    given_up_.push_back({KnownSurroundings(map, goal), 1});
  } else {
    again->goal = KnownSurroundings(map, again->goal.at());
    ++again->times;
  }
}

bool FrontierGoals::is_given_up(const Vector2d& goal) const {
  const FloorMap& map = situation_->map;
  const auto is_near = [&](const KnownSurroundings& other, double distance) {
    return (other.at() - goal).norm() < distance;
  };
  return std::ranges::any_of(given_up_, [&](const GivenUp& other) {
    if (other.times >= kInVain) return is_near(other.goal, kStillThere) && !other.goal.more_in(map);
    return is_near(other.goal, 3.0 * map.frame.resolution) && other.goal.same_as(map);
  });
}

}  // namespace cairn::exploration
