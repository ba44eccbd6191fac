// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/floor_map.hpp"

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/map_truth.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

using test::drawn_floor;
using test::drawn_map;

double entropy_of(double p) { return -p * std::log(p) - (1.0 - p) * std::log(1.0 - p); }

TEST(FloorMap, EntropyIsThatOfItsCells) {
  FloorMap map = drawn_map({"..#", "   "}, 0.5);
  // 2 free, 1 occupied, 3 unknown cells of 0.25 m².
  const double known = entropy_of(1.0 / (1.0 + std::exp(2.0)));
  EXPECT_NEAR(map.entropy(), 0.25 * (3.0 * known + 3.0 * std::numbers::ln2), 1e-12);
  EXPECT_DOUBLE_EQ(map.coverage(), 0.75);
  map.log_odds.assign(6, 700.0F);  // certain: nothing is left, and nothing overflows
  EXPECT_NEAR(map.entropy(), 0.0, 1e-12);
}

TEST(FloorMap, OccupancyHasTheProbabilityOfKnownCells) {
  const OccupancyGrid grid = drawn_map({".# "}).occupancy();
  EXPECT_EQ(grid.occupancy, (std::vector<std::int8_t>{12, 88, kUnknownCell}));
}

TEST(MapTruth, AMapIsComparedCellByCell) {
  const OccupancyGrid floor = drawn_floor({"########", "#...#..#", "#...#..#", "########"});
  // One free cell of the left room is not seen, one is taken for an obstacle far from a wall (the
  // walls around it are within a cell), and a wall is taken for free.
  FloorMap map = drawn_map({"########", "#.. #..#", "....#..#", "########"});
  const MapTruth truth = compare_with_floor(map, floor, {}, {1.5, 1.5});
  EXPECT_DOUBLE_EQ(truth.floor, 6.0);  // the room on the right hangs together with nothing
  EXPECT_DOUBLE_EQ(truth.seen, 5.0);
  EXPECT_DOUBLE_EQ(truth.free_wrong, 1.0);
  EXPECT_DOUBLE_EQ(truth.occupied_wrong, 0.0);
  EXPECT_FALSE(truth.reachable_seen);
}

TEST(MapTruth, OfWhatTheBodyCanCoverThePartThatIsKnownCounts) {
  const OccupancyGrid floor = drawn_floor({"######", "#....#", "######"});
  const FloorMap map = drawn_map({"######", "#.. .#", "######"});
  std::vector<std::uint8_t> reachable(floor.occupancy.size());
  for (const int x : {1, 2, 3}) reachable[floor.frame.index(x, 1)] = 1;
  const MapTruth truth = compare_with_floor(map, floor, {}, {1.5, 1.5}, reachable);
  EXPECT_DOUBLE_EQ(truth.reachable_seen.value(), 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(truth.seen, 3.0);
  // On a floor that is none of the robot's there is nothing to see.
  EXPECT_FALSE(
      compare_with_floor(map, floor, {}, {1.5, 1.5}, std::vector<std::uint8_t>(18)).reachable_seen);
  EXPECT_THROW(compare_with_floor(map, floor, {}, {1.5, 1.5}, std::vector<std::uint8_t>(5)), Error);
}

TEST(MapTruth, AnAlignmentTakesTheMapToTheFloor) {
  const std::vector<std::string> rows{"######", "#....#", "#.#..#", "######"};
  const OccupancyGrid floor = drawn_floor(rows);
  FloorMap map = drawn_map(rows);
  const Pose2 moved(3.0, -2.0, 0.5 * std::numbers::pi);
  map.frame.origin = moved.translation();
  map.frame.yaw = moved.theta();
  const MapTruth truth = compare_with_floor(map, floor, moved.inverse(), {1.5, 1.5});
  EXPECT_DOUBLE_EQ(truth.seen, truth.floor);
  EXPECT_EQ(truth.free_wrong, 0.0);
  EXPECT_EQ(truth.occupied_wrong, 0.0);
  EXPECT_GT(compare_with_floor(map, floor, {}, {1.5, 1.5}).floor - 1.0,
            compare_with_floor(map, floor, {}, {1.5, 1.5}).seen);
}

TEST(MapTruth, ObstaclesWhereTheFloorIsFreeAreWrongUnlessBesideAWall) {
  const OccupancyGrid floor = drawn_floor({".....", ".....", ".....", ".....", "....."});
  const FloorMap map = drawn_map({".....", ".....", "..#..", ".....", "....#"});
  // The one at the corner lies beside what is outside the floor.
  EXPECT_DOUBLE_EQ(compare_with_floor(map, floor, {}, {0.5, 0.5}).occupied_wrong, 1.0);
}

TEST(MapTruth, EndPointsInFreeCellsContradictTheMapOnce) {
  const FloorMap map = drawn_map({"....#"});
  LaserScan scan{.first_angle = 0.0, .angle_step = 0.0, .max_range = 8.0, .ranges = {}};
  // From (0.5, 0.5): the cells at 2, 2 again, 4 (an obstacle); nothing; a dropout.
  scan.ranges = {1.6F, 1.7F, 3.5F, 8.0F, std::nanf("")};
  const std::vector<LaserScan> scans{scan};
  const std::vector<Pose2> poses{Pose2(0.5, 0.5, 0.0)};
  EXPECT_DOUBLE_EQ(contradicted_area(map, scans, poses), 1.0);
}

}  // namespace
}  // namespace cairn
