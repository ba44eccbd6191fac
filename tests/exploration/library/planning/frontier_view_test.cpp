// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/frontier_view.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <ostream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/grid/cell_traversal.hpp"
#include "cairn/runtime/error.hpp"
#include "planning_maps.hpp"

namespace cairn {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

/// A lidar with a single beam: each orientation is then one layer of directions.
LidarModel single_beam(double range) { return {.aperture = 0.0, .beams = 1, .range = range}; }

/// The two convolutions of the thesis for one direction, cell by cell. `exact`: the same without
/// the frontiers that are hidden.
struct LiteralLayer {
  const FloorMap& map;
  int dx, dy;
  double beta;

  double image(int x, int y) const {
    if (!map.frame.contains(x, y)) return 0.0;
    const auto cell = static_cast<std::int32_t>(map.frame.index(x, y));
    const auto& frontier = map.frontiers.front().cells;
    if (std::ranges::binary_search(frontier, cell)) return 1.0;
    return map.cells[map.frame.index(x, y)] == CellState::occupied ? -1.0 : 0.0;
  }
  double part(int steps) const {
    return std::min(1.0, steps * std::hypot(dx, dy) * std::tan(beta));
  }

  double literal(int x, int y, int most) const {
    double vote = 0.0, parts = 0.0;
    for (int k = 1; k <= most; ++k) {
      vote += std::pow(0.5, k) * image(x + k * dx, y + k * dy);
      if (image(x + k * dx, y + k * dy) > 0.0) parts += part(k);
    }
    return vote > 0.0 ? parts : 0.0;
  }
  /// A corner between two cells that are not open decides where convolutions see none.
  bool meets_corner(int x, int y) const {
    if (dx == 0 || dy == 0) return false;
    for (; image(x, y) == 0.0; x += dx, y += dy)
      if (image(x + dx, y) != 0.0 && image(x, y + dy) != 0.0) return true;
    return false;
  }
  double exact(int x, int y, int most) const {
    for (int k = 1; k <= most; ++k) {
      const double value = image(x + k * dx, y + k * dy);
      if (value != 0.0) return value > 0.0 ? part(k) : 0.0;
    }
    return 0.0;
  }
};

/// Along the axes and diagonals the kernel of the convolutions holds the cells of the beam exactly.
TEST(FrontierView, AgreesWithTheConvolutionsOfTheThesisButForHiddenFrontiers) {
  test::Draw draw(5);
  constexpr int kMost = 40;
  constexpr double kSide = 0.1;
  double counted = 0.0, overcounted = 0.0;
  int beams = 0, corners = 0;
  for (int round = 0; round < 10; ++round) {
    const FloorMap map = test::random_map(draw, 32, 26, kSide);
    const ConfigurationSpace space(map, 0.1, 8);
    ASSERT_GT(space.size(), 0U);
    const FrontierView view(space, beam_cells(map), single_beam(1000.0), 360);
    constexpr int kDx[] = {1, 1, 0, -1, -1, -1, 0, 1}, kDy[] = {0, 1, 1, 1, 0, -1, -1, -1};
    for (int k = 0; k < 8; ++k) {
      const LiteralLayer layer{map, kDx[k], kDy[k], pi / 180.0};
      for (std::size_t n = 0; n < space.cells().size(); ++n) {
        const int x = space.cells()[n] % map.frame.width, y = space.cells()[n] / map.frame.width;
        ++beams;
        if (layer.meets_corner(x, y)) {
          ++corners;
          continue;
        }
        const double seen = view.seen(space.index(static_cast<std::int32_t>(n), k));
        const double exact = layer.exact(x, y, kMost), literal = layer.literal(x, y, kMost);
        ASSERT_NEAR(seen, exact, 1e-5) << x << " " << y << " " << k;
        ASSERT_GE(literal, exact);
        // Where the nearest is an obstacle both see nothing.
        ASSERT_EQ(literal > 0.0, exact > 0.0);
        counted += exact;
        overcounted += literal - exact;
      }
    }
  }
  EXPECT_LT(corners, beams / 20);
  // Hidden frontiers: on these maps the convolutions count 8 % more than what is seen.
  ASSERT_GT(counted, 0.0);
  EXPECT_NEAR(overcounted / counted, 0.08, 0.02);
}

/// Beams by exact traversal from the middle of a cell.
double cast(const FloorMap& map, const std::vector<BeamCell>& cells, int x, int y, double angle,
            double range, double beta) {
  const double side = map.frame.resolution, far = range / side;
  const Eigen::Vector2d from(x + 0.5, y + 0.5);
  const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
  double part = 0.0;
  traverse_cells(from, from + far * along, [&](int u, int v) {
    if (!map.frame.contains(u, v)) return false;
    const BeamCell cell = cells[map.frame.index(u, v)];
    if (cell == BeamCell::open) return true;
    if (cell == BeamCell::frontier) part = std::min(1.0, std::hypot(u - x, v - y) * std::tan(beta));
    return false;
  });
  return part;
}

struct Case {
  double aperture, yaw;
  int orientations, directions;

  friend void PrintTo(const Case& one, std::ostream* out) {
    *out << one.aperture << " " << one.yaw << " " << one.orientations << " " << one.directions;
  }
};

class Apertures : public testing::TestWithParam<Case> {};

/// A sheared line is off by less than a cell: single beams may meet another cell, their sums agree.
TEST_P(Apertures, SeesWhatPlainRayCastingSees) {
  const auto& [aperture, yaw, orientations, directions] = GetParam();
  test::Draw draw(23);
  FloorMap map = test::random_map(draw, 60, 50, 0.1);
  map.frame.yaw = yaw;
  const LidarModel lidar{.aperture = aperture, .beams = 181, .range = 2.5};
  const ConfigurationSpace space(map, 0.1, orientations);
  const std::vector<BeamCell> cells = beam_cells(map);
  const FrontierView view(space, cells, lidar, directions);
  const double beta = 2.0 * pi / directions;
  double difference = 0.0, sum = 0.0, balance = 0.0;
  int compared = 0, apart = 0;
  for (std::size_t n = 0; n < space.cells().size(); n += 7) {
    const int x = space.cells()[n] % map.frame.width, y = space.cells()[n] / map.frame.width;
    for (int k = 0; k < orientations; ++k) {
      double expected = 0.0;
      for (int j = 0; j < directions; ++j) {
        const double off = std::remainder(j * beta - space.heading(k), 2.0 * pi);
        if (std::abs(off) <= 0.5 * aperture + 1e-9)
          expected += cast(map, cells, x, y, j * beta - yaw, lidar.range, beta);
      }
      const double seen = view.seen(space.index(static_cast<std::int32_t>(n), k));
      ++compared;
      apart += std::abs(seen - expected) > 2.0 + 0.2 * expected;
      difference += std::abs(seen - expected);
      sum += expected;
      balance += seen - expected;
    }
  }
  ASSERT_GT(sum, 1000.0);
  EXPECT_LT(difference, 0.08 * sum);
  EXPECT_LT(std::abs(balance), 0.005 * sum);
  EXPECT_LT(apart, compared / 20);
}

INSTANTIATE_TEST_SUITE_P(Lidars, Apertures,
                         testing::Values(Case{pi, 0.0, 72, 360}, Case{2.0 * pi, 0.0, 8, 360},
                                         Case{0.5 * pi, 0.0, 36, 180}, Case{4.0, 0.0, 10, 251},
                                         Case{pi, 0.3, 24, 360}));

TEST(FrontierView, CountsTheCellsThatItNames) {
  test::Draw draw(29);
  const FloorMap map = test::random_map(draw, 50, 40, 0.1);
  const LidarModel lidar{.aperture = pi, .beams = 181, .range = 3.0};
  const ConfigurationSpace space(map, 0.1, 24);
  const std::vector<BeamCell> cells = beam_cells(map);
  const FrontierView view(space, cells, lidar, 360);
  double total = 0.0;
  for (std::size_t k = 0; k < space.size(); k += 13) {
    double sum = 0.0;
    for (const SeenFrontier& seen : frontiers_seen_from(space, cells, lidar, 360, k)) {
      ASSERT_EQ(cells[static_cast<std::size_t>(seen.cell)], BeamCell::frontier);
      sum += seen.part;
    }
    ASSERT_NEAR(view.seen(k), sum, 1e-3);
    total += sum;
  }
  EXPECT_GT(total, 100.0);
}

TEST(FrontierView, DoesNotSeeThroughAWallThatIsACellWide) {
  std::vector<std::string> rows(20, std::string(20, '.'));
  for (std::size_t k = 0; k < 20; ++k) {
    rows[k][k] = '#';  // from the upper left to the lower right
    rows[0][k] = '?';  // a frontier above it
  }
  FloorMap map = test::drawn_map(rows, 0.1);
  test::add_frontiers(map);
  const ConfigurationSpace space(map, 0.05, 72);
  const FrontierView view(space, beam_cells(map), {.aperture = 1.0, .beams = 2, .range = 5.0}, 360);
  const auto seen = [&](int x, int y) {
    return view.seen(space.index(space.number(x, y), 18));  // looking up
  };
  EXPECT_GT(seen(14, 14), 1.0);
  EXPECT_EQ(seen(9, 5), 0.0);
}

TEST(FrontierView, SeesNothingBeyondTheRange) {
  FloorMap map =
      test::drawn_map({"##########", "#........?", "#........?", "#........?", "##########"});
  test::add_frontiers(map);
  const ConfigurationSpace space(map, 0.5, 4);
  const std::int32_t number = space.number(2, 2);
  ASSERT_GE(number, 0);
  const auto seen = [&](double range) {
    return FrontierView(space, beam_cells(map), single_beam(range), 360)
        .seen(space.index(number, 0));
  };
  EXPECT_EQ(seen(5.9), 0.0);
  EXPECT_NEAR(seen(6.0), 6.0 * std::tan(pi / 180.0), 1e-5);
}

TEST(FrontierView, RefusesWhatMakesNoSense) {
  FloorMap map = test::drawn_map({"...", "...", "..."});
  test::add_frontiers(map);
  const ConfigurationSpace space(map, 0.1, 4);
  EXPECT_THROW(FrontierView(space, beam_cells(map), {}, 3), Error);
  const std::vector<BeamCell> few(2);
  try {
    const FrontierView view(space, few, {}, 360);
    FAIL() << "it took two cells for nine";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("2 cells for beams were given for a map of 9"));
  }
  EXPECT_THROW(ConfigurationSpace(map, 0.1, 0), Error);
}

}  // namespace
}  // namespace cairn
