// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/free_space.hpp"

#include <cmath>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

TEST(FreeSpace, IsWhatHangsTogetherWithWhereTheBodyIs) {
  const FloorMap map = test::drawn_map({"##########",  //
                                        "#....#...#",  //
                                        "#....#...#",  //
                                        "#....#...#",  //
                                        "##########"});
  const FreeSpace space(map, {2.5, 2.5}, 0.4);
  EXPECT_DOUBLE_EQ(space.area(), 12.0);
  EXPECT_EQ(space.entry(), (std::vector<Vector2d>{{2.5, 2.5}}));
  EXPECT_TRUE(space.contains(Vector2d(1.2, 3.7)));
  EXPECT_FALSE(space.contains(Vector2d(7.0, 2.0)));
  EXPECT_FALSE(space.contains(Vector2d(-1.0, 2.0)));
  EXPECT_FALSE(space.is_clear({2.5, 2.5}, {7.5, 2.5}));
  EXPECT_TRUE(space.is_clear({1.1, 1.1}, {4.9, 3.9}));
  // A larger body fits only away from the walls.
  EXPECT_DOUBLE_EQ(FreeSpace(map, {2.5, 2.5}, 1.2).area(), 2.0);
}

TEST(FreeSpace, SegmentsAreClearWhereEveryPointOfThemIs) {
  test::Draw draw(7);
  int clear = 0;
  for (int k = 0; k < 20; ++k) {
    std::vector<std::string> rows;
    for (int y = 0; y < 25; ++y) {
      std::string row;
      for (int x = 0; x < 25; ++x) row += draw.chance(0.02) ? '#' : '.';
      rows.push_back(row);
    }
    const FloorMap map = test::drawn_map(rows, 0.2);
    const double needed = needed_clearance(0.25, map.frame);
    const FreeSpace space(map, {2.5, 2.5}, 0.25);
    if (space.empty()) continue;
    for (int n = 0; n < 50; ++n) {
      const Vector2d a(draw.uniform(0.5, 4.5), draw.uniform(0.5, 4.5));
      const Vector2d b = a + Vector2d(draw.uniform(-1.5, 1.5), draw.uniform(-1.5, 1.5));
      bool every = true;
      constexpr int kPoints = 5000;
      for (int i = 0; i <= kPoints; ++i) {
        const Vector2d cell = map.frame.to_cells(a + (b - a) * (double(i) / kPoints));
        const int x = int(std::floor(cell.x())), y = int(std::floor(cell.y()));
        every = every && map.frame.contains(x, y) && map.clearance[map.frame.index(x, y)] >= needed;
      }
      // Other parts of the free cells do not belong to the space.
      if (!space.contains(a) || !space.contains(b)) continue;
      EXPECT_EQ(space.is_clear(a, b), every);
      clear += every;
    }
  }
  EXPECT_GT(clear, 100);
}

TEST(FreeSpace, SamplesAreUniform) {
  const FloorMap map = test::drawn_map({"#####", "#...#", "##..#", "#####"}, 0.5);
  const FreeSpace space(map, {0.75, 1.25}, 0.2);
  RandomNumbers random(5);
  std::map<std::pair<int, int>, int> count;  // by quarter of a cell
  constexpr int kSamples = 40000;
  for (int n = 0; n < kSamples; ++n) {
    const Vector2d point = space.sample(random);
    EXPECT_TRUE(space.contains(point));
    ++count[{int(std::floor(4.0 * point.x())), int(std::floor(4.0 * point.y()))}];
  }
  ASSERT_EQ(count.size(), 20U);
  double chi2 = 0.0;
  for (const auto& [where, number] : count)
    chi2 += std::pow(number - kSamples / 20.0, 2) / (kSamples / 20.0);
  EXPECT_LT(chi2, 43.8);  // the quantile 0.999 of 19 DoF
}

TEST(FreeSpace, IsEnteredFromTooNearAnObstacleWithoutComingNearer) {
  const FloorMap map = test::drawn_map({"########",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "########"});
  const FreeSpace space(map, {1.2, 3.5}, 2.0);  // needs 2.5 cells: those in the middle
  ASSERT_FALSE(space.empty());
  const std::vector<Vector2d>& entry = space.entry();
  ASSERT_EQ(entry.size(), 3U);
  EXPECT_EQ(entry.front(), Vector2d(1.2, 3.5));
  EXPECT_FALSE(space.contains(entry[1]));
  EXPECT_TRUE(space.contains(entry.back()));
  // Outside the map, and where the body fits nowhere, there is none.
  EXPECT_TRUE(FreeSpace(map, {-3.0, 1.0}, 0.3).empty());
  EXPECT_TRUE(FreeSpace(map, {3.5, 3.5}, 9.0).empty());
}

TEST(FreeSpace, ViewsAreTheNearestCellsThatSeeAGoal) {
  const FloorMap map =
      test::drawn_map({"########", "#......?", "#......?", "#......?", "########"});
  const FreeSpace space(map, {1.5, 2.5}, 1.2);  // stands in the row in the middle
  const auto view = space.view_of({6.5, 2.5}, 3.0);
  ASSERT_TRUE(view);
  EXPECT_EQ(*view, Vector2d(5.5, 2.5));
  EXPECT_FALSE(space.view_of({6.5, 2.5}, 0.5));
}

}  // namespace
}  // namespace cairn
