// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/discovered_floor.hpp"

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

/// A map of 12 × 12 cells of 0.1 m, known in its first columns.
FloorMap known_columns(int count, int first_column = 0) {
  std::vector<std::string> rows(12, std::string(12, ' '));
  for (std::string& row : rows) {
    for (int x = 0; x < count; ++x) row[static_cast<std::size_t>(x)] = x % 2 == 0 ? '.' : '#';
  }
  FloorMap map = test::drawn_map(rows, 0.1);
  map.frame.origin.x() = 0.1 * first_column;
  return map;
}

TEST(DiscoveredFloor, GrowsByHalfASquare) {
  DiscoveredFloor floor;
  EXPECT_FALSE(floor.grows(known_columns(0)));
  EXPECT_TRUE(floor.grows(known_columns(3)));
  EXPECT_FALSE(floor.grows(known_columns(3)));
  EXPECT_FALSE(floor.grows(known_columns(4))) << "a third of the next squares";
  EXPECT_TRUE(floor.grows(known_columns(5))) << "two thirds";
}

TEST(DiscoveredFloor, WhatAMapLosesAndFindsAgainIsNoDiscovery) {
  DiscoveredFloor floor;
  EXPECT_TRUE(floor.grows(known_columns(9)));
  EXPECT_FALSE(floor.grows(known_columns(3)));
  EXPECT_FALSE(floor.grows(known_columns(9)));
}

TEST(DiscoveredFloor, SquaresStayWhereTheyAreAsTheGridGrows) {
  DiscoveredFloor floor;
  EXPECT_TRUE(floor.grows(known_columns(6)));
  // The same columns, on a grid that begins three cells farther to the left.
  std::vector<std::string> rows(12, "   ......      ");
  FloorMap grown = test::drawn_map(rows, 0.1);
  grown.frame.origin.x() = -0.3;
  EXPECT_FALSE(floor.grows(grown));
  EXPECT_TRUE(floor.grows(known_columns(3, -3))) << "to the left of it";
}

TEST(DiscoveredFloor, SquaresAreOfWholeCells) {
  constexpr int kSide = 24;
  for (const auto& [resolution, side] : {std::pair(0.05, 6), {0.1, 3}, {0.2, 1}, {0.5, 1}}) {
    FloorMap map;
    map.frame = {.width = kSide, .height = kSide, .resolution = resolution};
    map.frame.origin = -12.0 * resolution * Eigen::Vector2d::Ones();
    map.cells.assign(map.frame.size(), CellState::unknown);
    DiscoveredFloor floor;
    EXPECT_FALSE(floor.grows(map));
    int discoveries = 0;
    for (CellState& cell : map.cells) {
      cell = CellState::free;
      discoveries += floor.grows(map);
    }
    EXPECT_EQ(discoveries, kSide * kSide / (side * side)) << resolution;
  }
}

}  // namespace
}  // namespace cairn
