// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/rrt_star.hpp"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

FloorMap two_rooms() {
  std::vector<std::string> rows(30, "#" + std::string(48, '.') + "#");
  rows.front() = rows.back() = std::string(50, '#');
  for (std::size_t y = 0; y < 30; ++y) {
    if (y < 12 || y > 18) rows[y][25] = '#';
  }
  return test::drawn_map(rows, 0.2);
}

/// A cost that is no metric and depends on the whole path: its turns, less for long paths. A path
/// may be better than its beginning.
struct TurnsPerMetre {
  struct State {
    double length = 0.0, turns = 0.0, direction = 0.0;
    int segments = 0;
  };
  State root(const Vector2d&) const { return {}; }
  State extended(const State& path, const Vector2d& from, const Vector2d& to, const State*) const {
    State state = path;
    const Vector2d apart = to - from;
    state.direction = std::atan2(apart.y(), apart.x());
    if (path.segments > 0)
      state.turns += std::abs(std::remainder(state.direction - path.direction, 2.0 * M_PI));
    state.length += apart.norm();
    ++state.segments;
    return state;
  }
  State adopted(State state, const State&) const { return state; }
  double value(const State& state) const {
    return state.segments == 0 ? 0.0 : (state.turns - 2.0 * std::sin(state.length)) / state.length;
  }
};

/// Every node's path, walked again from the root, has the value that is stored; parents and
/// children fit together, and all segments are clear.
template <class Cost>
void expect_sound(const RrtStar<Cost>& tree, const FreeSpace& space, Cost& cost) {
  int edges = 0;
  for (int k = 0; k < tree.size(); ++k) {
    const auto& node = tree.nodes()[std::size_t(k)];
    edges += int(node.children.size());
    for (const int child : node.children) EXPECT_EQ(tree.nodes()[std::size_t(child)].parent, k);
    const std::vector<int> path = tree.path(k);
    ASSERT_EQ(path.front(), 0);
    auto state = cost.root(tree.nodes().front().point);
    for (std::size_t i = 1; i < path.size(); ++i) {
      const Vector2d from = tree.nodes()[std::size_t(path[i - 1])].point;
      const Vector2d to = tree.nodes()[std::size_t(path[i])].point;
      EXPECT_TRUE(space.is_clear(from, to));
      state = cost.adopted(cost.extended(state, from, to, nullptr), state);
    }
    EXPECT_EQ(cost.value(state), tree.value(k)) << k;
  }
  EXPECT_EQ(edges, tree.size() - 1);
}

template <class Cost>
class RrtStarTree : public testing::Test {};
using Costs = testing::Types<PathLength, TurnsPerMetre>;
TYPED_TEST_SUITE(RrtStarTree, Costs);

TYPED_TEST(RrtStarTree, StoresTheCostsOfItsPathsThroughAllRewirings) {
  const FloorMap map = two_rooms();
  const FreeSpace space(map, {1.0, 1.0}, 0.2);
  TypeParam cost;
  RrtStar<TypeParam> tree(space, cost, {.step = 0.5, .reach = 1.5});
  RandomNumbers random(3);
  int rewired = 0;
  std::vector<int> parents;
  for (int n = 0; n < 1500; ++n) {
    tree.extend(space.sample(random));
    for (std::size_t k = 0; k < parents.size(); ++k)
      rewired += std::exchange(parents[k], tree.nodes()[k].parent) != tree.nodes()[k].parent;
    while (parents.size() < tree.nodes().size())
      parents.push_back(tree.nodes()[parents.size()].parent);
    if (n % 100 == 0) expect_sound(tree, space, cost);
  }
  expect_sound(tree, space, cost);
  EXPECT_GT(rewired, 300);
}

/// Paths are evaluated when they are asked for: whether some are on the way changes nothing.
TYPED_TEST(RrtStarTree, DoesNotDependOnWhenItsPathsAreAskedFor) {
  const FloorMap map = two_rooms();
  const FreeSpace space(map, {1.0, 1.0}, 0.2);
  TypeParam cost;
  RrtStar<TypeParam> late(space, cost, {.step = 0.5, .reach = 1.5}),
      always(space, cost, {.step = 0.5, .reach = 1.5}),
      one(space, cost, {.step = 0.5, .reach = 1.5});
  RandomNumbers random(4);
  for (int n = 0; n < 1500; ++n) {
    const Vector2d sample = space.sample(random);
    late.extend(sample);
    always.extend(sample);
    one.extend(sample);
    static_cast<void>(always.nodes());
    static_cast<void>(one.value(n * 7 % one.size()));
  }
  ASSERT_EQ(late.size(), always.size());
  ASSERT_EQ(late.size(), one.size());
  expect_sound(one, space, cost);
  for (int k = late.size(); k-- > 0;) {
    EXPECT_EQ(late.value(k), always.value(k));
    EXPECT_EQ(late.nodes()[std::size_t(k)].parent, always.nodes()[std::size_t(k)].parent);
    EXPECT_EQ(one.nodes()[std::size_t(k)].parent, always.nodes()[std::size_t(k)].parent);
  }
}

TYPED_TEST(RrtStarTree, TheSameSamplesGrowTheSameTree) {
  const FloorMap map = two_rooms();
  const FreeSpace space(map, {1.0, 1.0}, 0.2);
  TypeParam cost;
  const auto grown = [&](std::uint64_t seed) {
    RrtStar<TypeParam> tree(space, cost, {});
    RandomNumbers random(seed);
    EXPECT_TRUE(tree.grow(random, 5.0));
    return tree;
  };
  const auto a = grown(1), b = grown(1), other = grown(2);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(a.size(), int(std::ceil(5.0 * space.area())));
  for (int k = 0; k < a.size(); ++k) {
    EXPECT_EQ(a.nodes()[std::size_t(k)].point, b.nodes()[std::size_t(k)].point);
    EXPECT_EQ(a.nodes()[std::size_t(k)].parent, b.nodes()[std::size_t(k)].parent);
    EXPECT_EQ(a.value(k), b.value(k));
  }
  EXPECT_NE(a.nodes().back().point, other.nodes().back().point);
}

TEST(RrtStar, PathsApproachTheShortestAsTheTreeGrows) {
  const FloorMap map = two_rooms();
  const Vector2d start(1.0, 1.0);
  const FreeSpace space(map, start, 0.2);
  // To what can be seen from the start the shortest path is straight.
  PathLength cost;
  double before = 2.0;
  for (const double density : {2.0, 10.0, 50.0}) {
    RrtStar<PathLength> tree(space, cost, {.step = 0.5, .reach = 1.0});
    RandomNumbers random(7);
    tree.grow(random, density);
    double sum = 0.0;
    int seen = 0;
    for (int k = 1; k < tree.size(); ++k) {
      const Vector2d point = tree.nodes()[std::size_t(k)].point;
      EXPECT_GE(tree.value(k), (point - start).norm() - 1e-9);
      if (!space.is_clear(start, point)) continue;
      ++seen;
      sum += tree.value(k) / (point - start).norm();
    }
    ASSERT_GT(seen, 20);
    RecordProperty("density_" + std::to_string(int(density)), std::to_string(sum / seen));
    EXPECT_LT(sum / seen, before);
    before = sum / seen;
  }
  EXPECT_LT(before, 1.01);
}

TEST(RrtStar, ComesThroughNarrowDoorsIntoEveryRoom) {
  // Twelve rooms in a row, with doors as wide as a cell.
  std::vector<std::string> rows(12, std::string(121, '.'));
  for (std::size_t y = 0; y < 12; ++y) {
    for (std::size_t x = 0; x < 121; x += 10) rows[y][x] = y == 5 ? '.' : '#';
  }
  const FloorMap map = test::drawn_map(rows, 0.3);
  const FreeSpace space(map, {1.0, 1.0}, 0.1);
  PathLength cost;
  RrtStar<PathLength> tree(space, cost, {});
  RandomNumbers random(1);
  tree.grow(random, 2.0);
  expect_sound(tree, space, cost);
  const auto in_last_room = [](const auto& node) { return node.point.x() > 33.5; };
  EXPECT_GT(std::ranges::count_if(tree.nodes(), in_last_room), 2);
}

TEST(RrtStar, StopsWhenTheTimeIsOver) {
  const FloorMap map = two_rooms();
  const FreeSpace space(map, {1.0, 1.0}, 0.2);
  PathLength cost;
  RrtStar<PathLength> tree(space, cost, {});
  RandomNumbers random(1);
  EXPECT_FALSE(tree.grow(random, 1e6, 0.02));
  EXPECT_GT(tree.size(), 10);
  expect_sound(tree, space, cost);
}

TEST(RrtStar, BeginsWithTheWayOutOfTooNarrowAPlace) {
  const FloorMap map = test::drawn_map({"########",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "########"});
  const FreeSpace space(map, {1.2, 3.5}, 2.0);
  PathLength cost;
  RrtStar<PathLength> tree(space, cost, {.step = 1.0, .reach = 2.0});
  RandomNumbers random(1);
  tree.grow(random, 20.0);
  ASSERT_GT(tree.size(), 30);
  for (int k = 3; k < tree.size(); ++k) {
    const std::vector<int> path = tree.path(k);
    ASSERT_GE(path.size(), 4U);
    EXPECT_EQ(path[1], 1);
    EXPECT_EQ(path[2], 2);
  }
}

}  // namespace
}  // namespace cairn
