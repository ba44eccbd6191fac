// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/ray_caster.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

OccupancyGrid random_grid(test::Draw& draw, int width, int height, int one_of) {
  OccupancyGrid grid{
      {.width = width, .height = height, .resolution = 0.05, .origin = {-3.0, 7.0}, .yaw = 0.3},
      {}};
  for (std::int64_t k = 0; k < grid.frame.size(); ++k)
    grid.occupancy.push_back(draw.integer(one_of) == 0 ? (draw.integer(3) == 0 ? -1 : 100) : 0);
  return grid;
}

/// Walks along the ray in steps of a thousandth of a cell: the first cell that stops it.
RayHit walk(const OccupancyGrid& grid, const Vector2d& from, double angle, double range) {
  const GridFrame& frame = grid.frame;
  const Vector2d direction(std::cos(angle), std::sin(angle));
  for (double at = 0.0; at <= range; at += 0.001 * frame.resolution) {
    const Vector2d cells = frame.to_cells(from + at * direction).array().floor();
    const int x = static_cast<int>(cells.x()), y = static_cast<int>(cells.y());
    if (!frame.contains(x, y) || grid.occupancy[frame.index(x, y)] != 0)
      return {.range = at, .x = x, .y = y, .hit = true};
  }
  return {.range = range, .x = 0, .y = 0, .hit = false};
}

TEST(RayCaster, LeapsToTheCellsOfPlainTraversal) {
  test::Draw draw(3);
  for (const int one_of : {4, 50, 1000}) {
    const OccupancyGrid grid = random_grid(draw, 150, 110, one_of);
    const RayCaster caster(grid);
    for (int k = 0; k < 30000; ++k) {
      // Also from the middles and the corners of cells, and along and across them.
      Vector2d cells(draw.uniform(0.0, 150.0), draw.uniform(0.0, 110.0));
      if (k % 5 == 1) cells = cells.array().floor() + 0.5;
      if (k % 5 == 2) cells = cells.array().floor();
      double angle = draw.uniform(-7.0, 7.0);
      if (k % 3 == 0) angle = grid.frame.yaw + std::numbers::pi / 4 * draw.integer(8);
      const Vector2d from = grid.frame.to_world(cells);
      const double range = draw.uniform(0.0, 9.0);
      const RayHit leaping = caster.cast(from, angle, range),
                   plain = caster.cast_plainly(from, angle, range);
      ASSERT_EQ(leaping.hit, plain.hit) << k;
      ASSERT_EQ(leaping.range, plain.range) << k;
      if (!plain.hit) continue;
      ASSERT_EQ(leaping.x, plain.x) << k;
      ASSERT_EQ(leaping.y, plain.y) << k;
    }
  }
}

TEST(RayCaster, MeetsWhatAWalkAlongTheRayMeets) {
  test::Draw draw(5);
  const OccupancyGrid grid = random_grid(draw, 60, 40, 30);
  const RayCaster caster(grid);
  int same = 0, all = 0;
  for (int k = 0; k < 400; ++k) {
    const Vector2d from = grid.frame.to_world({draw.uniform(0.0, 60.0), draw.uniform(0.0, 40.0)});
    const double angle = draw.uniform(-3.0, 3.0), range = draw.uniform(0.1, 2.0);
    const RayHit ray = caster.cast(from, angle, range), walked = walk(grid, from, angle, range);
    ++all;
    same += ray.hit == walked.hit && (!ray.hit || (ray.x == walked.x && ray.y == walked.y));
    // A walk may step across a corner.
    if (ray.hit) {
      EXPECT_LE(ray.range, walked.range + 1e-9);
    }
    if (walked.hit && ray.hit && ray.x == walked.x && ray.y == walked.y) {
      EXPECT_NEAR(ray.range, walked.range, 0.0011 * grid.frame.resolution);
    }
  }
  EXPECT_GE(same, all - 4);
}

TEST(RayCaster, MeasuresToTheWallOfARoom) {
  OccupancyGrid room{{.width = 20, .height = 10, .resolution = 0.5},
                     std::vector<std::int8_t>(200, 0)};
  const RayCaster empty(room);
  const Vector2d from(2.25, 1.0);
  EXPECT_EQ(empty.cast(from, 0.0, 100.0).range, 7.75);  // the edge of the grid stops rays
  EXPECT_EQ(empty.cast(from, 0.0, 100.0).x, 20);
  EXPECT_NEAR(empty.cast(from, std::numbers::pi / 2, 100.0).range, 4.0, 1e-12);
  EXPECT_NEAR(empty.cast(from, std::numbers::pi, 100.0).range, 2.25, 1e-12);
  EXPECT_FALSE(empty.cast(from, 0.0, 7.7).hit);
  EXPECT_EQ(empty.cast(from, 0.0, 7.7).range, 7.7);
  room.occupancy[room.frame.index(12, 2)] = kUnknownCell;
  EXPECT_EQ(RayCaster(room).cast(from, 0.0, 100.0).range, 3.75);
  EXPECT_EQ(RayCaster(room).cast({6.2, 1.2}, 1.0, 100.0).range, 0.0) << "it begins in that cell";
}

TEST(RayCaster, FromOutsideOrFromNowhereNothingIsSeen) {
  const OccupancyGrid room{{.width = 4, .height = 4, .resolution = 1.0},
                           std::vector<std::int8_t>(16, 0)};
  const RayCaster caster(room);
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const Vector2d& from :
       {Vector2d(-1.0, 2.0), Vector2d(nan, 2.0), Vector2d(2.0, inf), Vector2d(1e300, 0.0)}) {
    EXPECT_TRUE(caster.cast(from, 0.0, 5.0).hit);
    EXPECT_EQ(caster.cast(from, 0.0, 5.0).range, 0.0);
  }
  EXPECT_TRUE(caster.cast({2.0, 2.0}, nan, 5.0).hit);
  EXPECT_EQ(caster.cast({2.5, 2.5}, 0.0, inf).range, 1.5);
  EXPECT_FALSE(caster.cast({2.5, 2.5}, 0.0, nan).hit);
}

}  // namespace
}  // namespace cairn
