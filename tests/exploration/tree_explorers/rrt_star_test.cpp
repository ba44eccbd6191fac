// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/grid/floor_survey.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/planning/free_space.hpp"
#include "cairn/plugin/registry.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "exploration/tree_explorers/known_floor.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

constexpr double kRadius = 0.2;

std::unique_ptr<PathPlanner> planner(const std::string& name) {
  return Registry().make<PathPlanner>(parse_component(name));
}

double length_of(const PlannedPath& path) {
  double length = 0.0;
  for (std::size_t k = 1; k < path.points.size(); ++k)
    length += (path.points[k] - path.points[k - 1]).norm();
  return length;
}

class KnownFloors : public testing::TestWithParam<const char*> {};

TEST_P(KnownFloors, PathsAreHardlyLongerThanThoseOverTheCells) {
  const test::KnownFloor floor = test::known_floor(GetParam(), 3);
  const auto tree = planner("rrt_star"), shortest = planner("grid_dijkstra:weight=0,margin=0");
  tree->start(floor.map, floor.start, kRadius);
  shortest->start(floor.map, floor.start, kRadius);
  const FreeSpace space(floor.map, floor.start, kRadius);
  RandomNumbers random(9);
  std::vector<double> ratios;
  for (int n = 0; n < 300; ++n) {
    const Vector2d goal = space.sample(random);
    const auto a = tree->path_to(goal, 1.0), b = shortest->path_to(goal, 1.0);
    ASSERT_TRUE(a) << goal.transpose();
    ASSERT_TRUE(b) << goal.transpose();
    EXPECT_NEAR(a->length, length_of(*a), 1e-9);
    EXPECT_EQ(a->points.front(), floor.start);
    EXPECT_EQ(a->points.back(), b->points.back());
    for (std::size_t k = 1; k < a->points.size(); ++k)
      EXPECT_TRUE(space.is_clear(a->points[k - 1], a->points[k]));
    if (b->length > 2.0) ratios.push_back(a->length / b->length);
  }
  const double mean = std::accumulate(ratios.begin(), ratios.end(), 0.0) / double(ratios.size());
  RecordProperty("mean_ratio", std::to_string(mean));
  EXPECT_LT(mean, 1.05);
  EXPECT_GT(mean, 0.97);  // the straightened path over cells is not the shortest there is
  EXPECT_LT(*std::ranges::max_element(ratios), 1.3);
}

INSTANTIATE_TEST_SUITE_P(Plans, KnownFloors,
                         testing::Values("rooms:width=14,height=10", "corridor:width=20,height=10",
                                         "loop:width=16,height=12", "cave:width=12,height=12"));

TEST(RrtStarPlanner, GivesTheSamePathsAgain) {
  const test::KnownFloor floor = test::known_floor("rooms:width=14,height=10", 3);
  const auto a = planner("rrt_star"), b = planner("rrt_star"), other = planner("rrt_star:seed=2");
  for (PathPlanner* each : {a.get(), b.get(), other.get(), b.get()})
    each->start(floor.map, floor.start, kRadius);
  const FreeSpace space(floor.map, floor.start, kRadius);
  RandomNumbers random(2);
  bool differs = false;
  for (int n = 0; n < 20; ++n) {
    const Vector2d goal = space.sample(random);
    const auto path = a->path_to(goal, 1.0);
    ASSERT_TRUE(path);
    EXPECT_EQ(path->points, b->path_to(goal, 1.0)->points);
    differs = differs || path->points != other->path_to(goal, 1.0)->points;
  }
  EXPECT_TRUE(differs);
}

TEST(RrtStarPlanner, HasNoPathWhereThereIsNone) {
  const FloorMap map = test::drawn_map({"#######", "#..#..#", "#..#..#", "#######"});
  const auto tree = planner("rrt_star");
  tree->start(map, {1.5, 1.5}, 0.4);
  EXPECT_FALSE(tree->path_to({4.5, 1.5}, 5.0));
  tree->start(map, {30.0, 1.5}, 0.4);  // outside
  EXPECT_FALSE(tree->path_to({1.5, 1.5}, 5.0));
}

}  // namespace
}  // namespace cairn
