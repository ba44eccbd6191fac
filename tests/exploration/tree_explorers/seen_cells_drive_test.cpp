// SPDX-License-Identifier: BSD-3-Clause
// What a drive is expected to discover beside what a simulated robot discovers on it.
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/planning/seen_cells.hpp"
#include "cairn/plugin/registry.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Cell = std::pair<int, int>;

/// A hall with pillars.
OccupancyGrid hall(test::Draw& draw) {
  std::vector<std::string> rows(60, "#" + std::string(78, '.') + "#");
  rows.front() = rows.back() = std::string(80, '#');
  for (int k = 0; k < 12; ++k) {
    const auto x = static_cast<std::size_t>(2 + draw.integer(75));
    const auto y = static_cast<std::size_t>(2 + draw.integer(55));
    rows[y][x] = rows[y][x + 1] = rows[y + 1][x] = '#';
  }
  return test::drawn_floor(rows, 0.1);
}

/// The map of a floor on which a part of the free cells is unknown; all walls are known.
FloorMap partly_known(const OccupancyGrid& floor, test::Draw& draw) {
  FloorMap map;
  map.frame = floor.frame;
  for (const std::int8_t value : floor.occupancy)
    map.cells.push_back(value > 50         ? CellState::occupied
                        : draw.chance(0.6) ? CellState::unknown
                                           : CellState::free);
  return map;
}

bool beside_obstacle(const FloorMap& map, int x, int y) {
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      if (map.frame.contains(u, v) && map.cells[map.frame.index(u, v)] == CellState::occupied)
        return true;
    }
  }
  return false;
}

TEST(SeenCells, AreWhatASimulatedRobotDiscoversOnItsDrive) {
  test::Draw draw(5);
  Registry registry;
  std::size_t total = 0;
  for (int k = 0; k < 5; ++k) {
    const OccupancyGrid floor = hall(draw);
    const FloorMap map = partly_known(floor, draw);
    const auto world = registry.make<World>(
        parse_component("lidar_building:range=2.5,fov=120,beams=90,range_sigma=0,radius=0.1"));
    const auto mapper = registry.make<Mapper>(parse_component("log_odds:smooth=false"));
    const Pose2 start(draw.uniform(2.0, 6.0), draw.uniform(2.0, 4.0), draw.uniform(-3.0, 3.0));
    const Eigen::Vector2d cell = start.translation() / 0.1;
    if (floor.occupancy[floor.frame.index(int(cell.x()), int(cell.y()))] != 0) continue;
    std::vector<Pose2> poses{start};
    try {
      mapper->add(start, world->begin({.floor = &floor, .pose = start}));
    } catch (const std::exception&) {
      continue;  // its body does not fit there
    }
    for (int n = 0; n < 8; ++n) {
      const WorldStep step = world->move(Pose2(draw.uniform(0.0, 0.5), 0.0, draw.uniform(-1, 1)));
      poses.push_back(*world->truth());
      mapper->add(poses.back(), step.scan);
    }
    const SeenCells seen(map, world->robot().lidar, 2.5);
    CellSet expected = seen.none();
    expected.add(seen.look(poses));
    const FloorMap& found = mapper->map();
    std::size_t discovered = 0;
    for (int y = 0; y < found.frame.height; ++y) {
      for (int x = 0; x < found.frame.width; ++x) {
        const Eigen::Vector2d middle = found.frame.centre(x, y);
        const Eigen::Vector2d on_floor = floor.frame.to_cells(middle).array().floor();
        const int u = int(on_floor.x()), v = int(on_floor.y());
        if (!floor.frame.contains(u, v)) continue;
        if (map.cells[floor.frame.index(u, v)] != CellState::unknown) continue;
        if (beside_obstacle(map, u, v)) continue;  // where the mapper puts the ends of beams
        const bool is_found = found.log_odds[found.frame.index(x, y)] != 0.0F;
        const Eigen::Vector2d in_set = seen.frame().to_cells(middle).array().floor();
        EXPECT_EQ(expected.contains(int(in_set.x()), int(in_set.y())), is_found) << u << " " << v;
        discovered += is_found;
      }
    }
    total += discovered;
  }
  EXPECT_GT(total, 1000U);
}

}  // namespace
}  // namespace cairn
