// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/scene.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <string_view>
#include <tuple>

#include "cairn/io/generator.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/scene_json.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/placeless.hpp"

namespace cairn::test {
namespace {

Simulation simulated(const std::string& kind) {
  Registry registry;
  return registry.make<Generator>(kind)->generate(registry, 3);
}

TEST(Scene, TellsOdometryFromLoopClosures) {
  const Graph graph = simulated("manhattan:poses=200").graph;
  const Scene scene = scene_of(graph, "city");
  EXPECT_EQ(scene.dimension, 2);
  EXPECT_EQ(scene.variable_count(), 200);
  EXPECT_EQ(scene.edge_count(), graph.factor_count());
  const std::vector<bool> closes = loop_closures(graph);
  int odometry = 0;
  for (int e = 0; e < scene.edge_count(); ++e) {
    EXPECT_EQ(scene.edge_class[e] == EdgeClass::loop, closes[e]) << e;
    odometry += scene.edge_class[e] == EdgeClass::odometry;
  }
  EXPECT_EQ(odometry, 199);
}

TEST(Scene, TellsLandmarksFromPoses) {
  const Scene scene = scene_of(simulated("landmarks2d").graph, "orchard");
  int seen = 0;
  for (int e = 0; e < scene.edge_count(); ++e) {
    if (scene.b[e] < 0) continue;
    const auto pose = [&](int v) { return scene.variable_types[scene.variable_type[v]].pose; };
    const bool mixed = pose(scene.a[e]) != pose(scene.b[e]);
    EXPECT_EQ(scene.edge_class[e] == EdgeClass::landmark, mixed);
    seen += mixed;
  }
  EXPECT_GT(seen, 10);
}

/// A velocity, which is nowhere.
struct Velocity : Placeless<2> {
  static constexpr std::string_view kTag = "VERTEX_VELOCITY";
};

/// Two poses, the velocity between them, and a point seen on the way.
struct Motion {
  static constexpr std::string_view kTag = "EDGE_MOTION";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Velocity, Se2, Se2, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& v, const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Vector<S, 2>& p, const Vector<double, 2>& z) {
    return v + a.template head<2>() - b.template head<2>() + p - z.template cast<S>();
  }
};

/// A pose and its velocity.
struct Speed {
  static constexpr std::string_view kTag = "EDGE_SPEED";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2, Velocity>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& a, const Vector<S, 2>& v,
                               const Vector<double, 2>& z) {
    return v - a.template head<2>() - z.template cast<S>();
  }
};

TEST(Scene, AFactorOnManyVariablesJoinsThoseThatAreSomewhere) {
  Graph graph;
  const auto pose = define_variable<Se2>();
  const auto velocity = define_variable<Velocity>();
  const auto point = define_variable<PointXY>();
  const auto motion = define_factor<Motion>();
  const std::array<double, 3> x{};
  const std::array<double, 2> p{};
  const std::array<double, 3> unit{1, 0, 1};
  std::array<int, 3> v{}, a{};
  for (int k = 2; k >= 0; --k) {  // by id, not by their order in the graph
    a[k] = graph.add_variable(pose, 10 + k, x);
    v[k] = graph.add_variable(velocity, 100 + k, p);
  }
  const int l = graph.add_variable(point, 200, p);
  graph.add_factor(motion, std::array{v[0], a[0], a[1], l}, p, unit);
  graph.add_factor(motion, std::array{v[1], a[2], a[0], l}, p, unit);
  graph.add_factor(define_factor<Speed>(), std::array{a[1], v[1]}, p, unit);
  const Scene scene = scene_of(graph, "imu");
  EXPECT_EQ(scene.a, (std::vector<std::int32_t>{a[0], a[0], a[2], a[2], a[1]}));
  EXPECT_EQ(scene.b, (std::vector<std::int32_t>{a[1], l, a[0], l, -1}));
  EXPECT_EQ(scene.edge_class,
            (std::vector{EdgeClass::odometry, EdgeClass::landmark, EdgeClass::loop,
                         EdgeClass::landmark, EdgeClass::other}));
  EXPECT_EQ(scene.factor, (std::vector<std::int32_t>{0, 0, 1, 1, 2}));
  EXPECT_EQ(scene.factors, 3);
}

TEST(Scene, PlacesVariablesWithTheResidualsThere) {
  const Graph graph = simulated("sphere:turns=4,poses_per_turn=10").graph;
  const Scene scene = scene_of(graph, "ball");
  const SceneEstimate estimate = place(graph, scene, "start", EstimateRole::initial);
  ASSERT_EQ(estimate.positions.size(), 3U * graph.variable_count());
  ASSERT_EQ(estimate.edge_chi2.size(), std::size_t(graph.factor_count()));
  for (int v = 0; v < graph.variable_count(); ++v) {
    for (int k = 0; k < 3; ++k) EXPECT_EQ(estimate.positions[3 * v + k], graph.state(v)[k]);
    for (int k = 0; k < 4; ++k) {
      EXPECT_NEAR(std::abs(estimate.orientation[4 * v + k]), std::abs(graph.state(v)[3 + k]), 1e-6);
    }
  }
  const std::vector<double> norms = squared_norms(graph);
  EXPECT_DOUBLE_EQ(estimate.chi2, std::accumulate(norms.begin(), norms.end(), 0.0));
}

TEST(Scene, LaysAnotherGraphOverById) {
  const Simulation simulation = simulated("manhattan:poses=50");
  Graph part;  // the truth of every second pose, backwards
  for (int v = 48; v >= 0; v -= 2) {
    part.add_variable(simulation.truth.variable_pools()[0].type, simulation.truth.id(v),
                      simulation.truth.state(v));
  }
  const Scene scene = scene_of(simulation.graph, "city");
  int matched = 0;
  const SceneEstimate truth = place_by_id(part, scene, "truth", EstimateRole::truth, matched);
  EXPECT_EQ(matched, 25);
  for (int v = 0; v < 50; ++v) {
    if (v % 2) {
      EXPECT_TRUE(std::isnan(truth.positions[2 * v]));
    } else {
      EXPECT_EQ(truth.positions[2 * v], simulation.truth.state(v)[0]);
    }
  }
}

TEST(Scene, AFileWithoutFactorsIsAPath) {
  const Graph graph = simulated("manhattan:poses=20").graph;
  Graph bare;
  for (int v = 19; v >= 0; --v) {
    bare.add_variable(graph.variable_pools()[0].type, graph.id(v), graph.state(v));
  }
  const Scene scene = scene_of(bare, "path");
  ASSERT_EQ(scene.edge_count(), 19);
  EXPECT_EQ(scene.factors, 0);
  for (int e = 0; e < 19; ++e) {
    EXPECT_EQ(scene.edge_class[e], EdgeClass::path);
    EXPECT_EQ(scene.ids[scene.b[e]], scene.ids[scene.a[e]] + 1);
  }
}

TEST(Scene, ItsStructureComesBackFromJson) {
  for (const char* kind :
       {"manhattan:poses=60", "landmarks2d", "sphere:turns=4,poses_per_turn=10"}) {
    const Scene scene = scene_of(simulated(kind).graph, "x");
    const Scene back = read_structure("{" + structure_json(scene) + "}", "test");
    EXPECT_EQ(back.dimension, scene.dimension);
    EXPECT_EQ(back.origin, scene.origin);
    EXPECT_EQ(back.ids, scene.ids);
    EXPECT_EQ(back.variable_type, scene.variable_type);
    EXPECT_EQ(back.fixed, scene.fixed);
    EXPECT_EQ(back.a, scene.a);
    EXPECT_EQ(back.b, scene.b);
    EXPECT_EQ(back.edge_class, scene.edge_class);
    EXPECT_EQ(back.factors, scene.factors);
    ASSERT_EQ(back.variable_types.size(), scene.variable_types.size());
    EXPECT_EQ(back.variable_types[0].tag, scene.variable_types[0].tag);
    EXPECT_EQ(back.variable_types[0].tangent_size, scene.variable_types[0].tangent_size);
  }
}

}  // namespace
}  // namespace cairn::test
