// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/cell_traversal.hpp"

#include <cmath>
#include <cstdlib>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Cells = std::vector<std::pair<int, int>>;

Cells traversed(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  Cells cells;
  traverse_cells(from, to, [&](int x, int y) {
    cells.emplace_back(x, y);
    return true;
  });
  return cells;
}

std::pair<int, int> cell_of(const Eigen::Vector2d& point) {
  return {static_cast<int>(std::floor(point.x())), static_cast<int>(std::floor(point.y()))};
}

/// Against the definition: the cells of many points along the segment.
TEST(TraverseCells, EntersEveryCellOfTheSegmentAndNoOther) {
  test::Draw draw(3);
  for (int k = 0; k < 500; ++k) {
    const Eigen::Vector2d from(draw.uniform(-9.0, 9.0), draw.uniform(-9.0, 9.0));
    const Eigen::Vector2d to(draw.uniform(-9.0, 9.0), draw.uniform(-9.0, 9.0));
    const Cells cells = traversed(from, to);
    const std::set<std::pair<int, int>> once(cells.begin(), cells.end());
    EXPECT_EQ(once.size(), cells.size());
    EXPECT_EQ(cells.front(), cell_of(from));
    EXPECT_EQ(cells.back(), cell_of(to));
    for (std::size_t i = 1; i < cells.size(); ++i) {
      EXPECT_EQ(std::abs(cells[i].first - cells[i - 1].first) +
                    std::abs(cells[i].second - cells[i - 1].second),
                1);
    }
    constexpr int kPoints = 2000;
    for (int i = 0; i <= kPoints; ++i)
      EXPECT_TRUE(once.contains(cell_of(from + (to - from) * (double(i) / kPoints))));
  }
}

TEST(TraverseCells, AlongAxesAndWithinOneCell) {
  EXPECT_EQ(traversed({0.5, 0.5}, {3.5, 0.5}), (Cells{{0, 0}, {1, 0}, {2, 0}, {3, 0}}));
  EXPECT_EQ(traversed({0.5, 2.5}, {0.5, 0.5}), (Cells{{0, 2}, {0, 1}, {0, 0}}));
  EXPECT_EQ(traversed({0.25, 0.25}, {0.75, 0.5}), (Cells{{0, 0}}));
  EXPECT_EQ(traversed({0.5, 0.5}, {0.5, 0.5}), (Cells{{0, 0}}));
}

TEST(TraverseCells, StopsWhenItIsTold) {
  int count = 0;
  EXPECT_FALSE(traverse_cells({0.5, 0.5}, {9.5, 0.5}, [&](int, int) { return ++count < 3; }));
  EXPECT_EQ(count, 3);
}

}  // namespace
}  // namespace cairn
