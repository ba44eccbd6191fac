// SPDX-License-Identifier: BSD-3-Clause
#include "random_paths.hpp"

#include <cstddef>
#include <optional>
#include <utility>

namespace cairn::app {

std::vector<PlannedPath> random_paths(const Situation& situation, PathPlanner& planner, int count,
                                      RandomNumbers& random) {
  const FloorMap& map = situation.map;
  std::vector<std::size_t> cells;
  for (std::size_t k = 0; k < map.cells.size(); ++k) {
    if (map.clearance[k] >= needed_clearance(situation.robot.radius, map.frame)) cells.push_back(k);
  }
  planner.start(map, situation.pose.translation(), situation.robot.radius);
  std::vector<PlannedPath> paths;
  while (!cells.empty() && std::ssize(paths) < count) {
    const std::size_t chosen = random.below(cells.size());
    const auto cell = static_cast<int>(cells[chosen]);
    cells[chosen] = cells.back();
    cells.pop_back();
    const auto goal = map.frame.centre(cell % map.frame.width, cell / map.frame.width);
    std::optional<PlannedPath> path = planner.path_to(goal, 2.0 * map.frame.resolution);
    if (path && path->length > situation.robot.step) paths.push_back(std::move(*path));
  }
  return paths;
}

}  // namespace cairn::app
