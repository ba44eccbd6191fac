// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/configuration_space.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"
#include "planning_maps.hpp"

namespace cairn {
namespace {

TEST(ConfigurationSpace, HoldsTheCellsWhereTheBodyFits) {
  test::Draw draw(3);
  const FloorMap map = test::random_map(draw, 30, 25, 0.1);
  const ConfigurationSpace space(map, 0.2, 16);
  std::size_t fits = 0;
  for (int y = 0; y < map.frame.height; ++y) {
    for (int x = 0; x < map.frame.width; ++x) {
      const std::size_t cell = map.frame.index(x, y);
      const bool expected = map.cells[cell] == CellState::free &&
                            map.clearance[cell] >= needed_clearance(0.2, map.frame);
      EXPECT_EQ(space.number(x, y) >= 0, expected);
      fits += expected;
    }
  }
  ASSERT_GT(fits, 0U);
  EXPECT_EQ(space.size(), 16 * fits);
  EXPECT_EQ(space.number(-1, 0), -1);
  for (std::size_t k = 0; k < space.size(); k += 5) {
    const Pose2 pose = space.pose(k);
    EXPECT_EQ(space.nearest(pose), k);
    EXPECT_EQ(space.nearest(Pose2(pose.x(), pose.y(), pose.theta() + 0.19)), k);
    EXPECT_NEAR(pose.theta(),
                std::remainder(space.heading(space.orientation_of(k)), 2 * std::numbers::pi), 1e-9);
    EXPECT_EQ(space.index(space.number_of(k), space.orientation_of(k) - 16), k);
  }
  EXPECT_FALSE(space.nearest(Pose2(-5.0, 0.0, 0.0)));
}

/// Against lengths that are relaxed until nothing changes.
TEST(PathLengths, AreTheShortestOverNeighbouringCells) {
  test::Draw draw(8);
  const FloorMap map = test::random_map(draw, 30, 25, 0.1);
  const ConfigurationSpace space(map, 0.1, 4);
  const auto count = static_cast<std::int32_t>(space.cells().size());
  const Eigen::Vector2d from = space.position(count / 2);
  const std::vector<float> lengths = path_lengths(space, map, from);
  std::vector<double> expected(space.cells().size(), INFINITY);
  expected[static_cast<std::size_t>(count / 2)] = 0.0;
  for (bool changed = true; changed;) {
    changed = false;
    for (std::int32_t n = 0; n < count; ++n) {
      const std::int32_t cell = space.cells()[static_cast<std::size_t>(n)];
      const int x = cell % map.frame.width, y = cell / map.frame.width;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const std::int32_t other = space.number(x + dx, y + dy);
          if (other < 0 || space.number(x + dx, y) < 0 || space.number(x, y + dy) < 0) continue;
          const double length =
              expected[static_cast<std::size_t>(other)] + 0.1 * std::hypot(dx, dy);
          double& mine = expected[static_cast<std::size_t>(n)];
          if (length >= mine - 1e-12) continue;
          mine = length;
          changed = true;
        }
      }
    }
  }
  int reached = 0;
  for (std::size_t n = 0; n < expected.size(); ++n) {
    if (std::isinf(expected[n])) {
      EXPECT_TRUE(std::isinf(lengths[n]));
    } else {
      EXPECT_NEAR(lengths[n], expected[n], 1e-4);
      ++reached;
    }
  }
  EXPECT_GT(reached, 10);
}

TEST(PathLengths, LeadOutOfWhereTheBodyDoesNotFit) {
  const FloorMap map = test::drawn_map({"#######", "#.....#", "#.....#", "#.....#", "#######"});
  const ConfigurationSpace space(map, 1.0, 4);  // the middle row alone
  ASSERT_EQ(space.cells().size(), 3U);
  const std::vector<float> lengths = path_lengths(space, map, {1.5, 1.5});
  EXPECT_NEAR(lengths[0], std::numbers::sqrt2, 1e-6);
  EXPECT_TRUE(std::isinf(path_lengths(space, map, {-3.0, 1.5})[0]));
}

}  // namespace
}  // namespace cairn
