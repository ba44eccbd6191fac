// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/plugin/registry.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using test::drawn_map;

constexpr double kRadius = 0.4;  // a body that stands on any free cell

std::unique_ptr<PathPlanner> shortest() {
  return Registry().make<PathPlanner>(parse_component("grid_dijkstra:weight=0"));
}

FloorMap random_map(test::Draw& draw, int size) {
  std::vector<std::string> rows;
  for (int y = 0; y < size; ++y) {
    std::string row;
    for (int x = 0; x < size; ++x) row += draw.chance(0.25) ? '#' : '.';
    rows.push_back(row);
  }
  return drawn_map(rows);
}

/// By cell the length of the shortest way over neighbours, where bodies stand, by relaxing all
/// edges again and again.
std::vector<double> literal_lengths(const FloorMap& map, int from_x, int from_y) {
  const GridFrame& frame = map.frame;
  std::vector<double> length(map.cells.size(), std::numeric_limits<double>::infinity());
  length[frame.index(from_x, from_y)] = 0.0;
  const auto stands = [&](int x, int y) {
    return frame.contains(x, y) &&
           map.clearance[frame.index(x, y)] >= needed_clearance(kRadius, frame);
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (int y = 0; y < frame.height; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        if (!stands(x, y)) continue;
        for (int v = y - 1; v <= y + 1; ++v) {
          for (int u = x - 1; u <= x + 1; ++u) {
            if (!stands(u, v) || !stands(u, y) || !stands(x, v)) continue;
            const double next = length[frame.index(u, v)] + std::hypot(u - x, v - y);
            if (next >= length[frame.index(x, y)] - 1e-9) continue;
            length[frame.index(x, y)] = next;
            changed = true;
          }
        }
      }
    }
  }
  return length;
}

TEST(GridDijkstra, PathsAreNoLongerThanTheShortestOverCellsAndStayClear) {
  test::Draw draw(5);
  const auto planner = shortest();
  int found = 0;
  for (int k = 0; k < 20; ++k) {
    const FloorMap map = random_map(draw, 12);
    const GridFrame& frame = map.frame;
    const int x = draw.integer(12), y = draw.integer(12);
    if (map.cells[frame.index(x, y)] != CellState::free) continue;
    planner->start(map, frame.centre(x, y), kRadius);
    const std::vector<double> lengths = literal_lengths(map, x, y);
    for (int v = 0; v < frame.height; ++v) {
      for (int u = 0; u < frame.width; ++u) {
        const auto path = planner->path_to(frame.centre(u, v), 0.5);
        const double length = lengths[frame.index(u, v)];
        ASSERT_EQ(path.has_value(), std::isfinite(length)) << u << " " << v;
        if (!path) continue;
        ++found;
        EXPECT_LE(path->length, length + 1e-5);
        EXPECT_GE(path->length, (frame.centre(u, v) - frame.centre(x, y)).norm() - 1e-9);
        EXPECT_EQ(path->points.front(), frame.centre(x, y));
        for (std::size_t i = 1; i < path->points.size(); ++i) {
          EXPECT_TRUE(traverse_cells(
              frame.to_cells(path->points[i - 1]), frame.to_cells(path->points[i]),
              [&](int a, int b) { return map.cells[frame.index(a, b)] == CellState::free; }));
        }
      }
    }
  }
  EXPECT_GT(found, 500);
}

TEST(GridDijkstra, GoesAsNearToTheGoalAsTheBodyCan) {
  const FloorMap map = drawn_map({"########", "#......?", "#......?", "#......?", "########"});
  const auto planner = shortest();
  planner->start(map, map.frame.centre(1, 2), 1.2);  // stands in the row in the middle
  const Vector2d goal = map.frame.centre(6, 2);
  const auto path = planner->path_to(goal, 3.0);
  ASSERT_TRUE(path);
  EXPECT_EQ(path->points.back(), map.frame.centre(5, 2));
  EXPECT_EQ(*path->look_at, goal);
  EXPECT_FALSE(planner->path_to(goal, 0.5));
}

TEST(GridDijkstra, DoesNotSeeAGoalThroughAWall) {
  const FloorMap map = drawn_map({"#######", "#..#..#", "#..#..#", "#######"});
  const auto planner = shortest();
  planner->start(map, map.frame.centre(1, 1), kRadius);
  EXPECT_FALSE(planner->path_to(map.frame.centre(4, 1), 5.0));
}

/// Of two doors the way leads through the farther one where a wall fills the cell of the nearer one
/// in part; where it does so in both, or lengths alone count, through the nearer one.
TEST(GridDijkstra, AvoidsCellsThatAWallFillsInPart) {
  FloorMap map = drawn_map({"###########", "#....#....#", "#.........#", "#....#....#",
                            "#....#....#", "#.........#", "#....#....#", "###########"},
                           0.5);
  const GridFrame& frame = map.frame;
  const int door = 5, near = 5, far = 2;
  const auto used = [&](PathPlanner& planner) {
    planner.start(map, frame.centre(3, 4), 0.2);
    const auto path = planner.path_to(frame.centre(7, 4), 0.1);
    int row = -1;
    if (!path) return row;
    for (std::size_t k = 1; k < path->points.size(); ++k) {
      traverse_cells(frame.to_cells(path->points[k - 1]), frame.to_cells(path->points[k]),
                     [&](int x, int y) {
                       if (x == door) row = y;
                       return true;
                     });
    }
    return row;
  };
  const auto careful = Registry().make<PathPlanner>(parse_component("grid_dijkstra"));
  EXPECT_EQ(used(*careful), near);
  map.caution = map.clearance;
  map.caution[frame.index(door, near)] = 0.0F;
  EXPECT_EQ(used(*careful), far);
  EXPECT_EQ(used(*shortest()), near);
  map.caution[frame.index(door, far)] = 0.0F;
  EXPECT_EQ(used(*careful), near);
}

/// It looks at a goal from where it can't touch anything, if there is such a place near.
TEST(GridDijkstra, LooksAtGoalsFromWhereThereIsRoom) {
  FloorMap map = drawn_map({"########", "#......#", "#......#", "########"}, 0.4);
  const GridFrame& frame = map.frame;
  const Vector2d goal = frame.centre(6, 1);
  const auto end = [&](const char* planner, int from) {
    const auto by = Registry().make<PathPlanner>(parse_component(planner));
    by->start(map, frame.centre(from, 1), 0.15);
    const auto path = by->path_to(goal, 2.0);
    return path->points.back();
  };
  const char* const careful = "grid_dijkstra";
  EXPECT_EQ(end(careful, 1), goal);
  map.caution = map.clearance;
  map.caution[frame.index(6, 1)] = 0.0F;
  EXPECT_NEAR((end(careful, 1) - goal).norm(), 0.4, 1e-9);
  EXPECT_EQ(end("grid_dijkstra:weight=0", 1), goal);
  EXPECT_EQ(end("grid_dijkstra:margin=0", 1), goal);
  for (const int x : {5, 6}) map.caution[frame.index(x, 2)] = 0.0F;
  EXPECT_EQ(end(careful, 5), goal);  // it stands at the only such place, and goes on
  map.caution[frame.index(5, 1)] = 0.0F;
  EXPECT_EQ(end(careful, 1), goal);  // the next one is too far away
  std::ranges::fill(map.caution, 0.0F);
  EXPECT_EQ(end(careful, 1), goal);
}

TEST(GridDijkstra, LeavesWhereTheBodyDoesNotFitAwayFromObstaclesOnly) {
  const FloorMap map = drawn_map(
      {"#########", "#.......#", "#.......#", "#.......#", "#.......#", "#.......#", "#########"});
  const auto planner = shortest();
  // Beside the wall, with a body that needs two cells.
  planner->start(map, map.frame.centre(1, 3), 1.5);
  const auto path = planner->path_to(map.frame.centre(6, 3), 1.1);
  ASSERT_TRUE(path);
  EXPECT_EQ(path->points.front(), map.frame.centre(1, 3));
  EXPECT_FALSE(planner->path_to(map.frame.centre(1, 1), 0.5));  // along the wall
}

}  // namespace
}  // namespace cairn
