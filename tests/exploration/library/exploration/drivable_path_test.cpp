// SPDX-License-Identifier: BSD-3-Clause
#include <atomic>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using std::numbers::pi;

/// A floor of free cells of 0.1 m with walls around it, and further ones that `wall` names.
template <class Wall>
FloorMap room(int width, int height, Wall&& wall) {
  FloorMap map;
  map.frame.width = width;
  map.frame.height = height;
  map.frame.resolution = 0.1;
  map.cells.assign(map.frame.size(), CellState::free);
  map.clearance.assign(map.frame.size(), 0.0F);
  std::vector<std::pair<int, int>> walls;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool edge = x == 0 || y == 0 || x == width - 1 || y == height - 1;
      if (!edge && !wall(x, y)) continue;
      map.cells[map.frame.index(x, y)] = CellState::occupied;
      walls.emplace_back(x, y);
    }
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double least = 1e9;
      for (const auto& [wall_x, wall_y] : walls)
        least = std::min(least, 0.1 * std::hypot(x - wall_x, y - wall_y));
      map.clearance[map.frame.index(x, y)] = static_cast<float>(least);
    }
  }
  return map;
}

FloorMap empty_room(int width, int height) {
  return room(width, height, [](int, int) { return false; });
}

RobotModel dubins_robot(double turning_radius) {
  RobotModel robot;
  robot.motion = MotionModel::dubins;
  robot.turning_radius = turning_radius;
  return robot;
}

/// Follows a path, with all that holds of every motion; returns where it ends.
Pose2 followed(Pose2 at, const PlannedPath& path, const RobotModel& robot, const FloorMap& map,
               double* driven = nullptr) {
  std::size_t passed = 0;
  int motions = 0;
  while (const auto motion = next_motion(at, path, robot, passed)) {
    if (++motions > 2000) {
      ADD_FAILURE() << "it does not end";
      break;
    }
    const double chord = motion->translation().norm(), half = 0.5 * motion->theta();
    const double length = std::abs(half) < 1e-9 ? chord : chord * half / std::sin(half);
    const double way = motion->x() > 0.0 ? 1.0 : -1.0;
    EXPECT_NEAR(std::atan2(way * motion->y(), way * motion->x()), half, 1e-9);
    EXPECT_LE(std::abs(motion->theta()) * robot.turning_radius, length + 1e-9);
    EXPECT_LE(std::abs(motion->theta()), robot.turn + 1e-9);
    EXPECT_LE(length, robot.step + 1e-9);
    at = at * *motion;
    const Vector2d cell = map.frame.to_cells(at.translation());
    EXPECT_GE(
        map.clearance[map.frame.index(static_cast<int>(cell.x()), static_cast<int>(cell.y()))],
        robot.radius);
    if (driven) *driven += length;
  }
  return at;
}

TEST(DrivablePath, IsThePathItselfForRobotsThatTurnInPlace) {
  const FloorMap map = empty_room(50, 50);
  const PlannedPath path{.points = {{1.0, 1.0}, {1.0, 3.0}}, .length = 2.0, .look_at = {}};
  for (const MotionModel motion : {MotionModel::differential, MotionModel::holonomic}) {
    RobotModel robot;
    robot.motion = motion;
    const auto same = drivable_path(path, Pose2(1.0, 1.0, 0.0), robot, map);
    ASSERT_TRUE(same);
    EXPECT_EQ(same->points, path.points);
  }
}

TEST(DrivablePath, LeadsToGoalsAllAroundTheRobot) {
  const FloorMap map = empty_room(80, 80);
  for (const double turning_radius : {0.2, 0.5, 1.0}) {
    const RobotModel robot = dubins_robot(turning_radius);
    for (int k = 0; k < 12; ++k) {
      const double angle = 2.0 * pi * k / 12;
      const Vector2d from(4.0, 4.0), to = from + 2.5 * Vector2d(std::cos(angle), std::sin(angle));
      const PlannedPath path{
          .points = {from, to}, .length = 2.5, .look_at = to + Vector2d(0.0, 1.0)};
      const Pose2 start(from.x(), from.y(), 0.3);
      const auto curve = drivable_path(path, start, robot, map);
      ASSERT_TRUE(curve) << turning_radius << ", " << k;
      double driven = 0.0;
      const Pose2 end = followed(start, *curve, robot, map, &driven);
      EXPECT_LT((end.translation() - to).norm(), 0.15);
      const Vector2d seen = end.transform_to(*path.look_at);
      EXPECT_LT(std::abs(std::atan2(seen.y(), seen.x())), 0.5 * robot.lidar.aperture);
      // Nothing is in its way: no detours beyond two circles.
      EXPECT_LT(driven, 2.5 + 4.0 * pi * 1.1 * turning_radius);
      EXPECT_NEAR(driven, curve->length, 0.1 * curve->length + 0.2);
    }
  }
}

TEST(DrivablePath, LeavesAPathAloneThatCanBeFollowed) {
  const FloorMap map = empty_room(60, 40);
  const PlannedPath path{.points = {{1.0, 2.0}, {4.0, 2.2}}, .length = 3.0, .look_at = {}};
  const auto same = drivable_path(path, Pose2(1.0, 2.0, 0.0), dubins_robot(0.5), map);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->points, path.points);
}

/// A room of 3 m × 3 m beside a corridor that is so many cells wide, an even number.
FloorMap room_and_corridor(int width = 10) {
  return room(80, 32,
              [=](int x, int y) { return x > 30 && (y < 16 - width / 2 || y >= 16 + width / 2); });
}

PlannedPath along_corridor() {
  return {.points = {{4.0, 1.6}, {7.0, 1.6}}, .length = 3.0, .look_at = Vector2d(8.0, 1.6)};
}

TEST(DrivablePath, TurnsRoundWhereThereIsRoom) {
  const FloorMap map = room_and_corridor(6);
  const RobotModel robot = dubins_robot(0.5);
  // Heads for the room, and the goal is behind it.
  const Pose2 start(4.0, 1.6, pi);
  const PlannedPath path = along_corridor();
  const auto curve = drivable_path(path, start, robot, map);
  ASSERT_TRUE(curve);
  const Pose2 end = followed(start, *curve, robot, map);
  EXPECT_LT((end.translation() - Vector2d(7.0, 1.6)).norm(), 0.15);
  EXPECT_LT(std::abs(end.theta()), 1.2);
  // It had to go as far as the room.
  double least = 4.0;
  for (const Vector2d& point : curve->points) least = std::min(least, point.x());
  EXPECT_LT(least, 3.2);
}

TEST(DrivablePath, TurnsRoundByBackingWhereThatIsShorter) {
  const FloorMap map = room_and_corridor();
  const RobotModel robot = dubins_robot(0.5);
  const Pose2 start(4.0, 1.6, pi);
  const PlannedPath path = along_corridor();
  const auto curve = drivable_path(path, start, robot, map);
  ASSERT_TRUE(curve);
  EXPECT_FALSE(curve->cusps.empty());
  // By the room it is 8 m.
  EXPECT_LT(curve->length, 6.0);
  const Pose2 end = followed(start, *curve, robot, map);
  EXPECT_LT((end.translation() - Vector2d(7.0, 1.6)).norm(), 0.15);
}

/// As trees of paths are, whose nodes are not joined for short paths alone.
TEST(DrivablePath, LeadsAlongWindingPaths) {
  const int lane = 35, lanes = 3;
  const FloorMap map = room(160, lanes * lane + 1, [](int x, int y) {
    return y % lane == 0 && ((y / lane) % 2 == 1 ? x < 130 : x > 30);
  });
  PlannedPath path;
  for (int k = 0; k < lanes; ++k) {
    for (int i = 0; i <= 12; ++i) {
      const double along = 1.5 + 13.0 / 12.0 * i, aside = i % 2 == 1 ? 1.2 : -1.2;
      path.points.emplace_back(k % 2 == 1 ? 16.0 - along : along, 0.1 * lane * (k + 0.5) + aside);
    }
  }
  for (std::size_t k = 1; k < path.points.size(); ++k)
    path.length += (path.points[k] - path.points[k - 1]).norm();
  const RobotModel robot = dubins_robot(0.5);
  const Pose2 start(path.points.front().x(), path.points.front().y(), pi);
  const auto curve = drivable_path(path, start, robot, map);
  ASSERT_TRUE(curve);
  EXPECT_LT(curve->length, 0.5 * path.length);
  const Pose2 end = followed(start, *curve, robot, map);
  EXPECT_LT((end.translation() - path.points.back()).norm(), 0.15);
}

TEST(DrivablePath, ThereIsNoneOnceTheSearchIsInterrupted) {
  const FloorMap map = room_and_corridor();
  const RobotModel robot = dubins_robot(0.5);
  const Pose2 start(4.0, 1.6, pi);
  const PlannedPath path = along_corridor();
  std::atomic<bool> interrupt = false;
  const auto curve = drivable_path(path, start, robot, map);
  const auto watched = drivable_path(path, start, robot, map, &interrupt);
  ASSERT_TRUE(curve && watched);
  EXPECT_EQ(watched->points, curve->points);
  interrupt = true;
  EXPECT_FALSE(drivable_path(path, start, robot, map, &interrupt));
}

TEST(DrivablePath, BacksOutWhereTheRobotCannotTurn) {
  const FloorMap map = room_and_corridor();
  // In the corridor, at its end, which it faces.
  const PlannedPath back{
      .points = {{7.0, 1.6}, {4.0, 1.6}}, .length = 3.0, .look_at = Vector2d(1.0, 1.6)};
  // And one that turns in a wider circle than the room is.
  const PlannedPath on{.points = {{4.0, 1.6}, {7.0, 1.6}}, .length = 3.0, .look_at = {}};
  for (const auto& [path, start, radius] :
       {std::tuple(back, Pose2(7.0, 1.6, 0.0), 0.5), std::tuple(on, Pose2(4.0, 1.6, pi), 1.4)}) {
    const RobotModel robot = dubins_robot(radius);
    const auto curve = drivable_path(path, start, robot, map);
    ASSERT_TRUE(curve);
    EXPECT_FALSE(curve->cusps.empty());
    double driven = 0.0;
    const Pose2 end = followed(start, *curve, robot, map, &driven);
    EXPECT_LT((end.translation() - path.points.back()).norm(), 0.15);
    EXPECT_NEAR(driven, curve->length, 0.1 * curve->length + 0.2);
  }
}

TEST(DrivablePath, ThereIsNoneThroughAWall) {
  const FloorMap map = room(80, 32, [](int x, int) { return x == 30; });
  const PlannedPath path{.points = {{2.0, 1.6}, {5.0, 1.6}}, .length = 3.0, .look_at = {}};
  EXPECT_FALSE(drivable_path(path, Pose2(2.0, 1.6, pi), dubins_robot(0.5), map));
}

/// A path with cusps: ahead, back along the same line, and ahead again.
TEST(NextMotion, BacksBetweenCusps) {
  const RobotModel robot = dubins_robot(0.5);
  const PlannedPath path{
      .points = {{0.0, 0.0}, {1.0, 0.0}, {-1.0, 0.0}, {2.0, 0.0}}, .length = 6.0, .cusps = {1, 2}};
  std::size_t passed = 0;
  Pose2 at;
  double ahead = 0.0, back = 0.0, least = 0.0;
  while (const auto motion = next_motion(at, path, robot, passed)) {
    EXPECT_NEAR(motion->y(), 0.0, 1e-12);
    (motion->x() > 0.0 ? ahead : back) += std::abs(motion->x());
    at = at * *motion;
    least = std::min(least, at.x());
    ASSERT_LT(ahead + back, 10.0);
  }
  EXPECT_NEAR(ahead, 4.0, 0.1);
  EXPECT_NEAR(back, 2.0, 0.1);
  EXPECT_NEAR(least, -1.0, 0.05);
  EXPECT_NEAR(at.x(), 2.0, 1e-9);
  // Backwards along an arc: a robot that drives ahead on its mirror image.
  const PlannedPath behind{.points = {{0.0, 0.0}, {-1.0, 0.5}}, .length = 1.2, .cusps = {0}};
  passed = 0;
  at = Pose2();
  int motions = 0;
  while (const auto motion = next_motion(at, behind, robot, passed)) {
    ASSERT_LT(++motions, 20);
    EXPECT_LT(motion->x(), 0.0);
    EXPECT_NEAR(std::atan2(-motion->y(), -motion->x()), 0.5 * motion->theta(), 1e-9);
    at = at * *motion;
  }
  EXPECT_LT((at.translation() - behind.points.back()).norm(), 0.1);
}

TEST(NextMotion, HolonomicDrivesAtOnceAndTurnsOnTheWay) {
  RobotModel robot;
  robot.motion = MotionModel::holonomic;
  const PlannedPath path{
      .points = {{0.0, 0.0}, {0.0, 2.0}}, .length = 2.0, .look_at = Vector2d(0.0, 5.0)};
  std::size_t passed = 0;
  Pose2 at;
  int motions = 0;
  while (const auto motion = next_motion(at, path, robot, passed)) {
    if (motions == 0) {
      EXPECT_NEAR(motion->y(), 0.5, 1e-12);
      EXPECT_NEAR(motion->x(), 0.0, 1e-12);
      EXPECT_NEAR(motion->theta(), robot.turn, 1e-12);
    }
    at = at * *motion;
    ASSERT_LT(++motions, 20);
  }
  EXPECT_LT((at.translation() - Vector2d(0.0, 2.0)).norm(), 0.1);
  EXPECT_NEAR(at.theta(), 0.5 * pi, 0.03);
  // 2 m in steps of 0.5 m, and what is left of the quarter turn; one that turns first takes 9.
  EXPECT_LE(motions, 6);
}

}  // namespace
}  // namespace cairn
