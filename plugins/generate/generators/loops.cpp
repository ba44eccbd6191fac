// SPDX-License-Identifier: BSD-3-Clause
#include "loops.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::generate {

std::array<std::int64_t, 3> CellGrid::cell_of(const std::array<double, 3>& at) const {
  std::array<std::int64_t, 3> cell;
  for (int k = 0; k < 3; ++k) cell[k] = static_cast<std::int64_t>(std::floor(at[k] / cell_));
  return cell;
}

void CellGrid::add(int index, const std::array<double, 3>& at, Random& random) {
  Cell& cell = cells_[key(cell_of(at))];
  ++cell.seen;
  if (capacity_ == 0 || static_cast<int>(cell.points.size()) < capacity_) {
    cell.points.push_back(index);
  } else if (const std::int64_t place = random.below(cell.seen); place < capacity_) {
    cell.points[static_cast<std::size_t>(place)] = index;
  }
}

template <class Pose>
std::vector<Loop> find_loops(const std::vector<Pose>& path, const LoopRule& rule, Random& random) {
  struct Candidate {
    double squared_distance;
    int index;
    bool operator<(const Candidate& other) const {
      return squared_distance != other.squared_distance ? squared_distance < other.squared_distance
                                                        : index < other.index;
    }
  };
  CellGrid grid(rule.radius, rule.cell_capacity);
  std::vector<Loop> loops;
  std::vector<Candidate> candidates;
  for (int k = rule.gap; k < static_cast<int>(path.size()); ++k) {
    // A pose enters the grid when it is far enough behind, so that all in the grid may be met
    // again.
    grid.add(k - rule.gap, position(path[k - rule.gap]), random);
    const std::array<double, 3> here = position(path[k]);
    candidates.clear();
    grid.around(here, [&](int index) {
      const std::array<double, 3> there = position(path[index]);
      const double dx = there[0] - here[0], dy = there[1] - here[1], dz = there[2] - here[2];
      const double squared = dx * dx + dy * dy + dz * dz;
      if (squared < rule.radius * rule.radius) candidates.push_back({squared, index});
    });
    std::sort(candidates.begin(), candidates.end());
    int closed = 0;
    for (const Candidate& candidate : candidates) {
      if (closed == rule.most) break;
      if (rotation_angle(between(path[candidate.index], path[k])) > rule.max_angle) continue;
      if (!random.chance(rule.probability)) continue;
      loops.push_back({candidate.index, k});
      ++closed;
    }
  }
  return loops;
}

template std::vector<Loop> find_loops(const std::vector<Pose2>&, const LoopRule&, Random&);
template std::vector<Loop> find_loops(const std::vector<Pose3>&, const LoopRule&, Random&);

}  // namespace cairn::generate
