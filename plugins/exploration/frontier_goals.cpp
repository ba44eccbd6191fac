// SPDX-License-Identifier: BSD-3-Clause
#include "frontier_goals.hpp"

#include <algorithm>
#include <cmath>
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
/// The map around a frontier [m], which must change before it is tried again; after so many times
/// in vain this part of it must have become known: single cells change with every scan where
/// measurements have noise.
constexpr double kAround = 1.0, kGrown = 0.05;
constexpr int kInVain = 2;
/// Between the cells of a frontier that are tried as goals [m].
constexpr double kSpacing = 0.5;

}  // namespace

void FrontierGoals::begin() {
  given_up_.clear();
  looked_around_ = 0.0;
}

void FrontierGoals::start(const Situation& situation, bool tight) {
  situation_ = &situation;
  const double cell = situation.map.frame.resolution, radius = situation.robot.radius;
  planner_->start(situation.map, situation.pose.translation(),
                  tight ? std::max(radius - cell, 0.5 * radius) : radius);
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
  if (!found.empty()) looked_around_ = 0.0;
  return found;
}

std::optional<PlannedPath> FrontierGoals::look_around() {
  const RobotModel& robot = situation_->robot;
  if (unreachable_ == 0 || robot.motion == MotionModel::dubins) return std::nullopt;
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
  path = driven(std::move(*path));
  if (!path || !moves(*path)) return std::nullopt;
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
  if (path) path = driven(std::move(*path));
  if (!path || moves(*path)) return path;
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

std::optional<PlannedPath> FrontierGoals::driven(PlannedPath path) const {
  return drivable_path(std::move(path), situation_->pose, situation_->robot, situation_->map,
                       situation_->interrupt);
}

bool FrontierGoals::moves(const PlannedPath& path) const {
  std::size_t passed = 0;
  return next_motion(situation_->pose, path, situation_->robot, passed).has_value();
}

void FrontierGoals::give_up(const Vector2d& goal) {
  const auto distance = [&](const GivenUp& other) { return (other.goal - goal).norm(); };
  const auto again = std::ranges::min_element(given_up_, {}, distance);
  if (again == given_up_.end() || distance(*again) >= kStillThere ||
      again->known == known_around(again->goal)) {  // another one, or another cell of the same
    given_up_.push_back({goal, known_around(goal), 1});
  } else {
    again->known = known_around(again->goal);
    ++again->times;
  }
}

bool FrontierGoals::is_given_up(const Vector2d& goal) const {
  const double cell = situation_->map.frame.resolution;
  const double side = 2.0 * kAround / cell;
  const auto grown = static_cast<std::size_t>(kGrown * side * side);
  return std::ranges::any_of(given_up_, [&](const GivenUp& other) {
    const bool in_vain = other.times >= kInVain;
    if ((other.goal - goal).norm() >= (in_vain ? kStillThere : 3.0 * cell)) return false;
    const std::size_t known = known_around(other.goal);
    return in_vain ? known <= other.known + grown : known == other.known;
  });
}

std::size_t FrontierGoals::known_around(const Vector2d& point) const {
  const FloorMap& map = situation_->map;
  const Vector2d cell = map.frame.to_cells(point).array().floor();
  const int reach = std::max(1, static_cast<int>(kAround / map.frame.resolution));
  const int middle_x = static_cast<int>(cell.x()), middle_y = static_cast<int>(cell.y());
  std::size_t known = 0;
  for (int y = middle_y - reach; y <= middle_y + reach; ++y) {
    for (int x = middle_x - reach; x <= middle_x + reach; ++x) {
      known += map.frame.contains(x, y) && map.cells[map.frame.index(x, y)] != CellState::unknown;
    }
  }
  return known;
}

}  // namespace cairn::exploration
