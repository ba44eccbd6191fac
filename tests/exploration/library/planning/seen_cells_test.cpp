// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/seen_cells.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "cairn/grid/ray_caster.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using Cell = std::pair<int, int>;

FloorMap random_map(test::Draw& draw, int width, int height, double resolution,
                    double unknown = 0.5) {
  std::vector<std::string> rows;
  for (int y = 0; y < height; ++y) {
    std::string row;
    for (int x = 0; x < width; ++x)
      row += draw.chance(0.05) ? '#' : draw.chance(unknown) ? '?' : '.';
    rows.push_back(row);
  }
  return test::drawn_map(rows, resolution);
}

/// Whether a ray enters a cell within a length [cells]: by its intersection with the square.
bool enters(const Vector2d& from, const Vector2d& direction, double length, const Cell& cell) {
  double begin = 0.0, end = length;
  for (int axis = 0; axis < 2; ++axis) {
    const double low = (axis == 0 ? cell.first : cell.second) - from[axis];
    const double a = low / direction[axis], b = (low + 1.0) / direction[axis];
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  return begin <= end;
}

/// The unknown cells in which beams are before the first obstacle that `RayCaster` finds, on a
/// grid with a margin of what is beyond the map, where nothing stands.
std::set<Cell> literally_seen(const FloorMap& map, const GridFrame& frame, const LidarModel& lidar,
                              double range, const Pose2& pose) {
  OccupancyGrid grid{frame, std::vector<std::int8_t>(static_cast<std::size_t>(frame.size()), 0)};
  const int margin = (frame.width - map.frame.width) / 2;
  const auto state = [&](int x, int y) {
    if (!map.frame.contains(x - margin, y - margin)) return CellState::unknown;
    return map.cells[map.frame.index(x - margin, y - margin)];
  };
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      if (state(x, y) == CellState::occupied) grid.occupancy[frame.index(x, y)] = 100;
    }
  }
  const RayCaster rays(grid);
  std::set<Cell> seen;
  const Vector2d from = frame.to_cells(pose.translation());
  for (int beam = 0; beam < lidar.beams; ++beam) {
    const double angle = pose.theta() + lidar.first_angle() + beam * lidar.step();
    const double length = rays.cast(pose.translation(), angle, range).range / frame.resolution;
    const Vector2d direction(std::cos(angle), std::sin(angle));
    for (int y = 0; y < frame.height; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        if (state(x, y) == CellState::unknown && enters(from, direction, length, {x, y}))
          seen.insert({x, y});
      }
    }
  }
  return seen;
}

std::set<Cell> cells_of(const CellSet& set, const GridFrame& frame) {
  std::set<Cell> cells;
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      if (set.contains(x, y)) cells.insert({x, y});
    }
  }
  return cells;
}

TEST(SeenCells, AreThoseThatTheBeamsOfTheWorldEnter) {
  test::Draw draw(3);
  const LidarModel lidar{.aperture = 0.75 * std::numbers::pi, .beams = 61, .range = 8.0};
  std::size_t total = 0;
  for (int k = 0; k < 12; ++k) {
    const double resolution = draw.uniform(0.05, 0.3);
    const FloorMap map = random_map(draw, 75, 20, resolution);
    const double range = 11.3 * resolution;
    const SeenCells seen(map, lidar, range);
    CellSet united = seen.none();
    std::set<Cell> expected;
    for (int n = 0; n < 4; ++n) {
      const Vector2d at = map.frame.to_world({draw.uniform(0.0, 75.0), draw.uniform(0.0, 20.0)});
      const Pose2 pose(at.x(), at.y(), draw.uniform(-3.0, 3.0));
      const Vector2d cell = map.frame.to_cells(at).array().floor();
      if (map.cells[map.frame.index(int(cell.x()), int(cell.y()))] == CellState::occupied) continue;
      expected.merge(literally_seen(map, seen.frame(), lidar, range, pose));
      const CellWindow window = seen.look(std::vector<Pose2>{pose});
      const std::size_t missing = united.missing(window), before = united.count();
      united.add(window);
      EXPECT_EQ(united.count(), before + missing);
      EXPECT_EQ(united.missing(window), 0U);
      ASSERT_EQ(cells_of(united, seen.frame()), expected) << k << " " << n;
    }
    EXPECT_EQ(united.count(), expected.size());
    total += united.count();
  }
  EXPECT_GT(total, 1000U);
}

/// The cells that a ray enters, cell by cell, with the borders' distances as `RayCaster` has them.
template <class Visit>
void traverse_plainly(const Vector2d& from, const Vector2d& direction, double length,
                      Visit&& visit) {
  const Eigen::Vector2i step(direction.x() < 0.0 ? -1 : 1, direction.y() < 0.0 ? -1 : 1);
  Eigen::Vector2i cell(int(std::floor(from.x())), int(std::floor(from.y())));
  const auto next = [&](int axis) {
    if (direction[axis] == 0.0) return std::numeric_limits<double>::infinity();
    const double border = direction[axis] > 0.0 ? cell[axis] + 1.0 : cell[axis];
    return (border - from[axis]) * (1.0 / direction[axis]);
  };
  while (visit(cell.x(), cell.y())) {
    const int axis = next(0) <= next(1) ? 0 : 1;
    if (!(next(axis) <= length)) return;
    cell[axis] += step[axis];
  }
}

TEST(SeenCells, AreThoseOfPlainTraversalToTheBit) {
  test::Draw draw(9);
  const LidarModel lidar{.aperture = 2.0 * std::numbers::pi, .beams = 64, .range = 8.0};
  const std::vector<Vector2d> beams = beam_directions(lidar);
  for (int k = 0; k < 16; ++k) {
    const FloorMap map = random_map(draw, 90, 60, 0.1, k % 4 < 2 ? 0.02 : 0.5);
    // Whole numbers of cells, so that ranges may end at borders.
    const double range = k % 2 == 0 ? 2.0 : draw.uniform(0.5, 3.0);
    const SeenCells seen(map, lidar, range);
    const GridFrame& frame = seen.frame();
    const int margin = (frame.width - map.frame.width) / 2;
    for (int n = 0; n < 12; ++n) {
      // At corners of cells, along their sides and diagonals, and anywhere.
      Vector2d at(draw.uniform(0.0, 90.0), draw.uniform(0.0, 60.0));
      double theta = draw.uniform(-3.0, 3.0);
      if (n % 2 == 0) at = at.array().floor().matrix().eval();
      if (n % 4 < 2) theta = 0.0;
      const Pose2 pose(map.frame.to_world(at).x(), map.frame.to_world(at).y(), theta);
      std::set<Cell> expected;
      const double c = std::cos(theta), s = std::sin(theta);
      for (const Vector2d& beam : beams) {
        const Vector2d direction(c * beam.x() - s * beam.y(), s * beam.x() + c * beam.y());
        traverse_plainly(frame.to_cells(pose.translation()), direction, range / frame.resolution,
                         [&](int x, int y) {
                           const bool on = map.frame.contains(x - margin, y - margin);
                           const CellState state =
                               on ? map.cells[map.frame.index(x - margin, y - margin)]
                                  : CellState::unknown;
                           if (state == CellState::unknown) expected.insert({x, y});
                           return state != CellState::occupied;
                         });
      }
      CellSet cells = seen.none();
      cells.add(seen.look(std::vector<Pose2>{pose}));
      ASSERT_EQ(cells_of(cells, frame), expected) << k << " " << n;
    }
  }
}

TEST(SeenCells, OfSeveralPosesAreTheUnionOfTheirs) {
  test::Draw draw(4);
  const FloorMap map = random_map(draw, 90, 40, 0.1);
  const SeenCells seen(map, {}, 2.0);
  std::vector<Pose2> poses;
  CellSet one_by_one = seen.none(), at_once = seen.none();
  for (int n = 0; n < 5; ++n) {
    poses.emplace_back(draw.uniform(3.0, 4.0), draw.uniform(1.5, 2.5), draw.uniform(-3.0, 3.0));
    one_by_one.add(seen.look(std::vector<Pose2>{poses.back()}));
  }
  at_once.add(seen.look(poses));
  EXPECT_EQ(cells_of(at_once, seen.frame()), cells_of(one_by_one, seen.frame()));
  EXPECT_EQ(at_once.count(), cells_of(at_once, seen.frame()).size());
}

TEST(SeenCells, StopAtKnownObstaclesAndAtTheRange) {
  // The robot stands at x = 1.5 m; a wall hides what is behind it, and nothing is farther than 3 m.
  const FloorMap map = test::drawn_map({"????????", "..?#????", "????????"});
  const LidarModel ahead{.aperture = 0.01, .beams = 1, .range = 8.0};
  const SeenCells seen(map, ahead, 3.0);
  CellSet cells = seen.none();
  cells.add(seen.look(std::vector<Pose2>{Pose2(1.5, 1.5, 0.0)}));
  EXPECT_EQ(cells.count(), 1U);
  cells.add(seen.look(std::vector<Pose2>{Pose2(1.5, 1.5, std::numbers::pi / 2.0)}));
  EXPECT_EQ(cells.count(), 4U);  // one in the map, two beyond
  EXPECT_DOUBLE_EQ(seen.entropy_change(cells.count()), -4.0 * std::numbers::ln2);
}

TEST(SeenCells, AKnownFloorHasNone) {
  const FloorMap map = test::drawn_map({"#####", "#...#", "#####"});
  const SeenCells seen(map, {}, 4.0);
  EXPECT_TRUE(seen.look(std::vector<Pose2>{Pose2(2.5, 1.5, 0.3)}).empty());
}

}  // namespace
}  // namespace cairn
