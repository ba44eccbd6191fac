// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdint>
#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/grid/floor_plan.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

OccupancyGrid floor_of(const std::string& name, std::uint64_t seed) {
  return Registry().make<FloorPlan>(name)->generate(seed);
}

/// Parts of the free floor that hang together by sides.
int parts(OccupancyGrid grid) {
  const GridFrame& frame = grid.frame;
  int count = 0;
  for (std::size_t begin = 0; begin < grid.occupancy.size(); ++begin) {
    if (grid.occupancy[begin] != 0) continue;
    ++count;
    std::vector<std::size_t> open{begin};
    grid.occupancy[begin] = 1;
    while (!open.empty()) {
      const int x = static_cast<int>(open.back()) % frame.width,
                y = static_cast<int>(open.back()) / frame.width;
      open.pop_back();
      for (const auto& [u, v] :
           {std::pair{x - 1, y}, std::pair{x + 1, y}, std::pair{x, y - 1}, std::pair{x, y + 1}}) {
        if (!frame.contains(u, v) || grid.occupancy[frame.index(u, v)] != 0) continue;
        grid.occupancy[frame.index(u, v)] = 1;
        open.push_back(frame.index(u, v));
      }
    }
  }
  return count;
}

class FloorPlans : public testing::TestWithParam<const char*> {};

TEST_P(FloorPlans, AreEnclosedAndOfOnePiece) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const OccupancyGrid grid = floor_of(GetParam(), seed);
    const GridFrame& frame = grid.frame;
    for (int x = 0; x < frame.width; ++x) {
      ASSERT_EQ(grid.occupancy[frame.index(x, 0)], 100);
      ASSERT_EQ(grid.occupancy[frame.index(x, frame.height - 1)], 100);
    }
    for (int y = 0; y < frame.height; ++y) {
      ASSERT_EQ(grid.occupancy[frame.index(0, y)], 100);
      ASSERT_EQ(grid.occupancy[frame.index(frame.width - 1, y)], 100);
    }
    EXPECT_EQ(parts(grid), 1) << GetParam() << " seed " << seed;
    const auto free = std::ranges::count(grid.occupancy, 0);
    EXPECT_EQ(free + std::ranges::count(grid.occupancy, 100), frame.size());
    EXPECT_GT(static_cast<double>(free), 0.2 * static_cast<double>(frame.size()));
  }
}

TEST_P(FloorPlans, DependOnTheSeedAndOnNothingElse) {
  EXPECT_EQ(floor_of(GetParam(), 7).occupancy, floor_of(GetParam(), 7).occupancy);
  EXPECT_NE(floor_of(GetParam(), 7).occupancy, floor_of(GetParam(), 8).occupancy);
}

INSTANTIATE_TEST_SUITE_P(All, FloorPlans,
                         testing::Values("rooms", "rooms:width=60,height=8,room=2",
                                         "rooms:resolution=0.1,loops=0", "corridor",
                                         "corridor:room=2.5,width=17", "loop", "cave",
                                         "cave:grain=0.3,density=0.4"),
                         [](const auto& plan) { return "Plan" + std::to_string(plan.index); });

/// A checksum (FNV-1a) of the cells.
std::uint64_t checksum(const OccupancyGrid& grid) {
  std::uint64_t sum = 0xcbf29ce484222325U;
  for (const std::int8_t cell : grid.occupancy)
    sum = (sum ^ static_cast<std::uint8_t>(cell)) * 0x100000001b3U;
  return sum;
}

TEST(FloorPlan, IsTheSameOnEveryMachine) {
  EXPECT_EQ(checksum(floor_of("rooms", 3)), 6875148228503030437U);
  EXPECT_EQ(checksum(floor_of("corridor", 3)), 17536397520293366277U);
  EXPECT_EQ(checksum(floor_of("loop", 3)), 362010026576899173U);
  EXPECT_EQ(checksum(floor_of("cave", 3)), 10590384664305006573U);
}

TEST(FloorPlan, AWallHasOneDoorAndByOptionASecond) {
  // Of each part, a wall less is a part less: with one door per wall the rooms are a tree.
  const OccupancyGrid one = floor_of("rooms:loops=0", 5), two = floor_of("rooms:loops=1", 5);
  EXPECT_GT(std::ranges::count(two.occupancy, 0), std::ranges::count(one.occupancy, 0));
}

TEST(FloorPlan, WhatHasNoRoomIsRefused) {
  for (const char* name :
       {"corridor:height=4", "loop:width=5,height=5", "cave:density=0.7,rounds=9",
        "rooms:width=1000,height=1000,resolution=0.005"})
    EXPECT_THROW(floor_of(name, 0), Error) << name;
}

}  // namespace
}  // namespace cairn
