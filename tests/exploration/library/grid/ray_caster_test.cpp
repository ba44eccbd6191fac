// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/ray_caster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
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

/// Those that this machine can run.
std::vector<std::string> kernel_sets() {
  std::vector<std::string> sets;
  for (const char* name : {"portable", "avx2", "avx512"}) {
    try {
      const RayCaster caster({{.width = 1, .height = 1, .resolution = 1.0}, {0}}, {}, name);
      sets.emplace_back(name);
    } catch (const Error&) {
    }
  }
  return sets;
}

std::vector<Vector2d> beams_at(const std::vector<double>& angles) {
  std::vector<Vector2d> beams;
  for (const double angle : angles) beams.emplace_back(std::cos(angle), std::sin(angle));
  return beams;
}

/// Casts a scan by all kernels, and expects of each ray what exact traversal meets.
void expect_exact(const std::vector<RayCaster>& casters, const Vector2d& from, double heading,
                  const std::vector<Vector2d>& beams, double range) {
  std::vector<RayHit> plain(beams.size());
  casters.front().cast_plainly(from, heading, beams, range, plain);
  for (std::size_t set = 0; set < casters.size(); ++set) {
    std::vector<RayHit> hits(beams.size(), RayHit{.range = -1.0, .x = -7, .y = -7});
    casters[set].cast(from, heading, beams, range, hits);
    for (std::size_t k = 0; k < beams.size(); ++k) {
      ASSERT_EQ(hits[k].hit, plain[k].hit) << kernel_sets()[set] << ", beam " << k;
      ASSERT_EQ(hits[k].range, plain[k].range) << kernel_sets()[set] << ", beam " << k;
      ASSERT_EQ(hits[k].x, plain[k].x) << kernel_sets()[set] << ", beam " << k;
      ASSERT_EQ(hits[k].y, plain[k].y) << kernel_sets()[set] << ", beam " << k;
    }
  }
}

std::vector<RayCaster> casters_of(const OccupancyGrid& grid) {
  std::vector<RayCaster> casters;
  for (const std::string& kernels : kernel_sets())
    casters.emplace_back(grid, CellThresholds{}, kernels);
  return casters;
}

TEST(RayCaster, SideBySideRaysMeetTheCellsOfExactTraversal) {
  test::Draw draw(3);
  for (const int one_of : {4, 50, 1000}) {
    const OccupancyGrid grid = random_grid(draw, 150, 110, one_of);
    const std::vector<RayCaster> casters = casters_of(grid);
    for (int k = 0; k < 2000; ++k) {
      // Also from the middles and the corners of cells, and along and across them.
      Vector2d cells(draw.uniform(0.0, 150.0), draw.uniform(0.0, 110.0));
      if (k % 5 == 1) cells = cells.array().floor() + 0.5;
      if (k % 5 == 2) cells = cells.array().floor();
      double heading = draw.uniform(-7.0, 7.0);
      if (k % 3 == 0) heading = grid.frame.yaw + std::numbers::pi / 4 * draw.integer(8);
      // Close to one another, far apart, clockwise, in no order.
      std::vector<double> angles(static_cast<std::size_t>(1 + draw.integer(40)));
      const double step = k % 2 == 0 ? std::numbers::pi / 180 : draw.uniform(-0.5, 0.5);
      for (std::size_t beam = 0; beam < angles.size(); ++beam)
        angles[beam] = k % 7 == 3 ? draw.uniform(-4.0, 4.0) : step * static_cast<double>(beam);
      expect_exact(casters, grid.frame.to_world(cells), heading, beams_at(angles),
                   k % 11 == 0 ? 1e300 : draw.uniform(0.0, 9.0));
      ASSERT_FALSE(HasFailure()) << one_of << ", scan " << k;
    }
  }
}

TEST(RayCaster, AndThoseThatGrazeTheBordersOfCells) {
  test::Draw draw(4);
  const OccupancyGrid grid = random_grid(draw, 150, 110, 30);
  const std::vector<RayCaster> casters = casters_of(grid);
  for (int k = 0; k < 3000; ++k) {
    // Less than the error of a sum in fixed point beside a corner, towards others.
    const double off = std::pow(10.0, draw.uniform(-16.0, -3.0));
    Vector2d cells(10 + draw.integer(130), 10 + draw.integer(90));
    cells += off * Vector2d(draw.integer(3) - 1, draw.integer(3) - 1);
    std::vector<double> angles;
    for (int beam = 0; beam < 16; ++beam)
      angles.push_back(std::atan2(draw.integer(19) - 9, draw.integer(19) - 9) +
                       off * draw.integer(2));
    if (k % 2 == 0) std::ranges::sort(angles);
    expect_exact(casters, grid.frame.to_world(cells), grid.frame.yaw, beams_at(angles), 9.0);
    ASSERT_FALSE(HasFailure()) << k;
  }
}

TEST(RayCaster, AndThoseOnGridsLongerThanSumsAreExact) {
  test::Draw draw(5);
  for (const bool wide : {false, true}) {
    OccupancyGrid grid{{.width = wide ? 70000 : 3, .height = wide ? 3 : 70000, .resolution = 0.1},
                       std::vector<std::int8_t>(210000, 0)};
    for (int k = 0; k < 40; ++k)
      grid.occupancy[static_cast<std::size_t>(draw.integer(210000))] = 100;
    const std::vector<RayCaster> casters = casters_of(grid);
    for (int k = 0; k < 200; ++k) {
      const double far = draw.uniform(0.0, 7000.0), near = draw.uniform(0.0, 0.3);
      std::vector<double> angles;
      for (int beam = 0; beam < 9; ++beam)
        angles.push_back((wide ? 0.0 : 1.5707963) + std::numbers::pi * (beam % 2) +
                         std::pow(10.0, draw.uniform(-7.0, -2.0)));
      expect_exact(casters, wide ? Vector2d(far, near) : Vector2d(near, far), 0.0, beams_at(angles),
                   k % 2 == 0 ? 9000.0 : 500.0);
      ASSERT_FALSE(HasFailure()) << k;
    }
  }
}

TEST(RayCaster, NamesTheKernelsThatItDoesNotHave) {
  const OccupancyGrid grid{{.width = 1, .height = 1, .resolution = 1.0}, {0}};
  const auto with = [&](const char* kernels) { return RayCaster(grid, {}, kernels); };
  EXPECT_THAT([&] { with("neon"); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("no kernels 'neon'")));
  std::vector<RayHit> hits(3);
  EXPECT_THROW(RayCaster(grid).cast({0.5, 0.5}, 0.0, beams_at({0.0, 1.0}), 1.0, hits), Error);
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
  const std::vector<Vector2d> beam = beams_at({0.0});
  const auto cast = [&](const Vector2d& from, double angle, double range) {
    RayHit hit;
    caster.cast(from, angle, beam, range, {&hit, 1});
    const RayHit one = caster.cast(from, angle, range);
    EXPECT_EQ(hit.hit, one.hit);
    EXPECT_TRUE(hit.range == one.range || std::isnan(range));
    return hit;
  };
  for (const Vector2d& from :
       {Vector2d(-1.0, 2.0), Vector2d(nan, 2.0), Vector2d(2.0, inf), Vector2d(1e300, 0.0)}) {
    EXPECT_TRUE(cast(from, 0.0, 5.0).hit);
    EXPECT_EQ(cast(from, 0.0, 5.0).range, 0.0);
  }
  EXPECT_TRUE(cast({2.0, 2.0}, nan, 5.0).hit);
  EXPECT_EQ(cast({2.5, 2.5}, 0.0, inf).range, 1.5);
  EXPECT_FALSE(cast({2.5, 2.5}, 0.0, nan).hit);
  EXPECT_FALSE(cast({2.5, 2.5}, 0.0, -1.0).hit);
}

}  // namespace
}  // namespace cairn
