// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_value.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/planning/path_motions.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "path_graphs.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

/// (5.10) of a polyline, all from its definition: motion by motion, pose by pose.
double literal_value(const test::PathGraph& graph, const PathValueOptions& options,
                     const std::vector<Vector2d>& points) {
  const Situation situation = graph.situation();
  PathInformationOptions information_options = options.information;
  information_options.entropy = options.objective.entropy;
  const auto no_wall = [&](const Pose2& older, const Pose2& newer) {
    constexpr int kPoints = 400;
    for (int k = 0; k <= kPoints; ++k) {
      const Vector2d at =
          older.translation() + (newer.translation() - older.translation()) * (double(k) / kPoints);
      const Vector2d cell = graph.map.frame.to_cells(at).array().floor();
      const int x = int(cell.x()), y = int(cell.y());
      if (graph.map.frame.contains(x, y) &&
          graph.map.cells[graph.map.frame.index(x, y)] == CellState::occupied)
        return false;
    }
    return true;
  };
  PathInformation information(situation, information_options, no_wall);
  PathInformation::State path = information.start();
  const SeenCells seen(graph.map, graph.robot.lidar, options.simulated_range);
  const bool turns_in_place = graph.robot.motion != MotionModel::dubins;
  std::set<std::pair<int, int>> cells;
  for (std::size_t k = 1; k < points.size(); ++k) {
    const PlannedPath segment{.points = {points[k]},
                              .length = (points[k] - path.pose().translation()).norm()};
    const std::vector<Pose2> motions = motions_along(path.pose(), segment, graph.robot);
    double heading = path.pose().theta(), driven = 0.0;  // of the last scan that counts, and since
    for (std::size_t i = 0; i < motions.size(); ++i) {
      path = information.extended(path, motions[i]);
      driven += motions[i].translation().norm();
      // Scans between two that overlap, on a turn on the spot or less than a step along arcs, do
      // not count.
      if (i + 1 < motions.size() && driven + motions[i + 1].translation().norm() <=
                                        (turns_in_place ? 0.0 : graph.robot.step)) {
        const double next = path.pose().theta() + motions[i + 1].theta();
        const double apart = std::abs(std::remainder(next - heading, 2.0 * std::numbers::pi));
        if (apart <= graph.robot.lidar.aperture) continue;
      }
      heading = path.pose().theta();
      driven = 0.0;
      CellSet set = seen.none();
      set.add(seen.look({&path.pose(), 1}));
      for (int y = 0; y < seen.frame().height; ++y) {
        for (int x = 0; x < seen.frame().width; ++x) {
          if (set.contains(x, y)) cells.insert({x, y});
        }
      }
    }
  }
  const JointObjective objective(options.objective, graph.map.frame.resolution,
                                 graph.robot.lidar.range);
  const Eigen::Matrix3d now = information.start().covariance();
  const double map_change = -0.25 * 0.25 * std::log(2.0) * static_cast<double>(cells.size());
  const InformationChange change =
      objective.change(path.trajectory_change(), map_change, now, path.covariance());
  return objective.value(change, graph.map.entropy(), now) / std::max(path.length(), 0.5);
}

std::vector<PathValueOptions> several_options() {
  std::vector<PathValueOptions> options(3);
  options[1].objective = {.entropy = EntropyForm::thesis, .alpha = AlphaForm::both, .power = 0.3};
  options[1].simulated_range = 2.0;
  options[2].information.loops = LoopForm::thesis;
  options[2].information.loop_gain = 0.1;
  return options;
}

template <class Cost>
std::vector<Vector2d> points_to(const RrtStar<Cost>& tree, int node) {
  std::vector<Vector2d> points;
  for (const int k : tree.path(node)) points.push_back(tree.nodes()[std::size_t(k)].point);
  return points;
}

TEST(PathValue, OfATreeGrownForItIsThatOfEachPathAnew) {
  std::uint64_t seed = 1;
  int loops = 0, rewired = 0;
  std::size_t cells = 0;
  for (const PathValueOptions& options : several_options()) {
    const test::PathGraph graph = test::partly_explored(++seed);
    const Situation situation = graph.situation();
    const FreeSpace space(graph.map, graph.pose.translation(), graph.robot.radius);
    ASSERT_FALSE(space.empty());
    PathValue value(situation, options);
    RrtStar<PathValue> tree(space, value, {});
    RandomNumbers random(seed);
    tree.grow(random, 2.0);
    ASSERT_GT(tree.size(), 50);
    for (int k = 1; k < tree.size(); k += 3) {
      const PathValue::State& state = tree.nodes()[std::size_t(k)].state;
      const double expected = literal_value(graph, options, points_to(tree, k));
      EXPECT_NEAR(tree.value(k), expected, 1e-8 * (1.0 + std::abs(expected))) << k;
      EXPECT_EQ(state.cells, state.seen->count());
      loops += state.information.loops();
      cells += state.cells;
      rewired += tree.nodes()[std::size_t(k)].parent > k;
    }
  }
  EXPECT_GT(loops, 10);
  EXPECT_GT(cells, 1000U);
  EXPECT_GT(rewired, 10);
}

TEST(PathValue, OfATreeForARobotThatCannotTurnInPlaceIsThatOfEachPathAnew) {
  const PathValueOptions options;
  test::PathGraph graph = test::partly_explored(3);
  graph.robot.motion = MotionModel::dubins;
  const Situation situation = graph.situation();
  const FreeSpace space(graph.map, graph.pose.translation(), graph.robot.radius);
  ASSERT_FALSE(space.empty());
  PathValue value(situation, options);
  RrtStar<PathValue> tree(space, value, {});
  RandomNumbers random(3);
  tree.grow(random, 2.0);
  ASSERT_GT(tree.size(), 50);
  for (int k = 1; k < tree.size(); k += 3) {
    const double expected = literal_value(graph, options, points_to(tree, k));
    EXPECT_NEAR(tree.value(k), expected, 1e-8 * (1.0 + std::abs(expected))) << k;
  }
}

TEST(PathValue, OfATreeOfShortPathsIsThatOfEachPathAnew) {
  std::uint64_t seed = 5;
  for (const PathValueOptions& options : several_options()) {
    const test::PathGraph graph = test::partly_explored(++seed);
    const Situation situation = graph.situation();
    const FreeSpace space(graph.map, graph.pose.translation(), graph.robot.radius);
    ASSERT_FALSE(space.empty());
    PathLength length;
    RrtStar<PathLength> tree(space, length, {});
    RandomNumbers random(seed);
    tree.grow(random, 2.0);
    PathValue value(situation, options);
    const auto values = path_values(tree, value);
    ASSERT_EQ(values.size(), std::size_t(tree.size()));
    for (int k = 1; k < tree.size(); k += 5) {
      ASSERT_TRUE(values[std::size_t(k)]);
      const double expected = literal_value(graph, options, points_to(tree, k));
      EXPECT_NEAR(values[std::size_t(k)]->value, expected, 1e-8 * (1.0 + std::abs(expected))) << k;
    }
    const auto none = path_values(tree, value, -1.0);
    EXPECT_TRUE(none.front());
    EXPECT_EQ(std::ranges::count_if(none, [](const auto& state) { return state.has_value(); }), 1);
  }
}

TEST(PathValue, EvaluatesEstimatedPathsExactly) {
  const test::PathGraph graph = test::partly_explored(2);
  const Situation situation = graph.situation();
  const FreeSpace space(graph.map, graph.pose.translation(), graph.robot.radius);
  PathValueOptions options;
  options.information.sampled_poses = 3;
  PathValue value(situation, options);
  RrtStar<PathValue> tree(space, value, {});
  RandomNumbers random(2);
  tree.grow(random, 2.0);
  int estimated = 0;
  for (int k = 1; k < tree.size(); k += 3) {
    const PathValue::State& state = tree.nodes()[std::size_t(k)].state;
    const double expected = literal_value(graph, options, points_to(tree, k));
    EXPECT_FALSE(state.is_exact);
    const PathValue::State exact = value.evaluated(state);
    EXPECT_TRUE(exact.is_exact);
    EXPECT_NEAR(exact.value, expected, 1e-8 * (1.0 + std::abs(expected))) << k;
    estimated += std::abs(state.value - expected) > 1e-6 * std::abs(expected);
  }
  EXPECT_GT(estimated, 5);
}

TEST(PathValue, CellsThatAreLeftOutDoNotCount) {
  const test::PathGraph graph = test::partly_explored(3);
  const Situation situation = graph.situation();
  PathValue all(situation);
  const auto path = [&](PathValue& value) {
    PathValue::State state = value.root(graph.pose.translation());
    for (const double x : {0.3, 0.8, 1.3}) {
      const Vector2d to = graph.pose * Vector2d(x, 0.2);
      state = value.adopted(value.extended(state, to, to, nullptr), state);
    }
    return state;
  };
  const PathValue::State before = path(all);
  std::vector<Vector2d> points = all.seen_cells().middles(*before.seen);
  ASSERT_EQ(points.size(), before.cells);
  ASSERT_GT(points.size(), 20U);
  points.resize(10);
  PathValue some(situation, {}, points);
  EXPECT_EQ(path(some).cells, before.cells - 10);
}

}  // namespace
}  // namespace cairn
