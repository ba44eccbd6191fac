// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/normalized_error.hpp"

#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::HasSubstr;

class NormalizedErrorIn : public testing::TestWithParam<int> {
 protected:
  Simulation estimated(std::uint64_t seed) {
    Simulation sim = simulate(registry, generator, seed);
    registry.make<Optimizer>("levenberg_marquardt")->optimize(sim.graph);
    return sim;
  }
  /// Moves all of it, and leaves the last variables out.
  Graph moved(const Graph& graph, const PoseWorld::Pose& by, int without = 0) const {
    Graph copy;
    for (int v = graph.variable_count() - 1; v >= without; --v)
      copy.add_variable(world.types().pose, graph.id(v), world.compose(by, graph.state(v)));
    return copy;
  }

  Registry registry;
  std::string generator =
      GetParam() == 2
          ? "ring:poses=30,laps=2,loop_radius=2,translation_sigma=0.02,rotation_sigma=0.004"
          : "sphere:turns=4,poses_per_turn=8,radius=4,translation_sigma=0.01,rotation_sigma=0.002";
  PoseWorld world{types_of(GetParam(), registry)};
};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, NormalizedErrorIn, testing::Values(2, 3));

TEST(NormalizedError, CountsLandmarks) {
  Registry registry;
  Simulation sim = simulate(registry, "landmarks2d:poses=60", 3);
  registry.make<Optimizer>("levenberg_marquardt")->optimize(sim.graph);
  const PoseWorld world{planar_types(registry)};
  // The truth of another frame, in another order.
  const PoseWorld::Pose by{3.0, -2.0, 1.1};
  const auto [R, t] = world.split(by);
  Graph truth;
  for (int v = sim.truth.variable_count() - 1; v >= 0; --v) {
    const auto x = sim.truth.state(v);
    if (x.size() == 3) {
      truth.add_variable(sim.truth.variable(v).type, sim.truth.id(v), world.compose(by, x));
    } else {
      const Eigen::Vector3d p = R * Eigen::Vector3d(x[0], x[1], 0.0) + t;
      truth.add_variable(sim.truth.variable(v).type, sim.truth.id(v), std::vector{p.x(), p.y()});
    }
  }
  const Graph& graph = sim.graph;
  std::vector<bool> held(static_cast<std::size_t>(graph.variable_count()));
  held[0] = true;
  const DenseSystem system = dense_system(graph, held);
  VectorXd e(system.H.rows());
  const auto back = world.compose(graph.state(0), world.inverse(sim.truth.state(0)));
  const auto [R_back, t_back] = world.split(back);
  int landmarks = 0;
  for (int v = 1; v < graph.variable_count(); ++v) {
    const auto rows = system.rows.at(graph.id(v));
    const auto x = graph.state(v), true_x = sim.truth.state(*sim.truth.find(graph.id(v)));
    if (x.size() == 3) {
      e.segment(rows.first, 3) = world.log(world.between(x, world.compose(back, true_x)));
      continue;
    }
    const Eigen::Vector3d p = R_back * Eigen::Vector3d(true_x[0], true_x[1], 0.0) + t_back;
    e.segment(rows.first, 2) = p.head<2>() - Eigen::Vector2d(x[0], x[1]);
    ++landmarks;
  }
  const NormalizedError error = normalized_error(graph, truth);
  EXPECT_GT(landmarks, 3);
  EXPECT_EQ(error.dof, static_cast<int>(e.size()));
  EXPECT_NEAR(error.squared, e.dot(system.H * e), 1e-6 * error.squared);
  EXPECT_LT(error.squared, 2.0 * error.dof);
}

TEST_P(NormalizedErrorIn, IsTheErrorsMahalanobisNorm) {
  const Simulation sim = estimated(3);
  const Graph& graph = sim.graph;
  std::vector<bool> held(static_cast<std::size_t>(graph.variable_count()));
  held[0] = true;
  const DenseSystem system = dense_system(graph, held);
  VectorXd e(system.H.rows());
  const auto by = world.compose(graph.state(0), world.inverse(sim.truth.state(0)));
  for (int v = 1; v < graph.variable_count(); ++v) {
    const auto rows = system.rows.at(graph.id(v));
    e.segment(rows.first, rows.size) =
        world.log(world.between(graph.state(v), world.compose(by, sim.truth.state(v))));
  }
  const NormalizedError error = normalized_error(graph, sim.truth);
  EXPECT_EQ(error.dof, static_cast<int>(e.size()));
  EXPECT_NEAR(error.squared, e.dot(system.H * e), 1e-8 * error.squared);
  EXPECT_GT(error.squared, 1.0);
}

TEST_P(NormalizedErrorIn, DoesNotDependOnTheFrameOrTheOrderOfTheTruth) {
  const Simulation sim = estimated(4);
  Draw draw(1);
  const double squared = normalized_error(sim.graph, sim.truth).squared;
  for (int trial = 0; trial < 5; ++trial) {
    const auto by = world.random(draw, 50.0, 1.7);
    EXPECT_NEAR(normalized_error(sim.graph, moved(sim.truth, by)).squared, squared, 1e-6 * squared);
  }
  EXPECT_NEAR(normalized_error(sim.graph, moved(sim.graph, world.random(draw, 5.0, 1.0))).squared,
              0.0, 1e-12);
}

TEST_P(NormalizedErrorIn, IsAsLargeAsItsDegreesOfFreedomInTheMean) {
  constexpr int kRuns = 200;
  double sum = 0.0, squares = 0.0;
  int dof = 0;
  for (int seed = 1; seed <= kRuns; ++seed) {
    const Simulation sim = estimated(static_cast<std::uint64_t>(seed));
    const NormalizedError error = normalized_error(sim.graph, sim.truth);
    dof = error.dof;
    sum += error.squared / kRuns;
    squares += error.squared * error.squared / kRuns;
  }
  // χ²: mean n, variance 2n.
  EXPECT_NEAR(sum, dof, 4.0 * std::sqrt(2.0 * dof / kRuns) + 0.01 * dof);
  EXPECT_NEAR((squares - sum * sum) / (2.0 * dof), 1.0, 0.5);
}

TEST_P(NormalizedErrorIn, ShowsAnOverconfidentEstimate) {
  Simulation sim = simulate(registry, generator, 5);
  for (int f = 0; f < sim.graph.factor_count(); ++f) {
    const auto z = sim.graph.measurement(f), omega = sim.graph.information(f);
    const std::vector<double> measured(z.begin(), z.end());
    std::vector<double> more(omega.begin(), omega.end());
    for (double& number : more) number *= 4.0;
    sim.graph.set_measurement(f, measured, more);
  }
  registry.make<Optimizer>("levenberg_marquardt")->optimize(sim.graph);
  const Simulation honest = estimated(5);
  EXPECT_NEAR(normalized_error(sim.graph, sim.truth).squared,
              4.0 * normalized_error(honest.graph, honest.truth).squared,
              1e-3 * normalized_error(sim.graph, sim.truth).squared);
}

TEST_P(NormalizedErrorIn, SaysWhatTheTruthLacks) {
  const Simulation sim = estimated(6);
  try {
    normalized_error(sim.graph, moved(sim.truth, world.identity(), 2));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr(" 0"));
  }
  Graph other;
  const PoseWorld different(GetParam() == 3 ? planar_types(registry)
                                            : PoseTypes{registry.variable_type("VERTEX_SE3:QUAT"),
                                                        registry.factor_type("EDGE_SE3:QUAT")});
  for (int v = 0; v < sim.graph.variable_count(); ++v)
    other.add_variable(different.types().pose, sim.graph.id(v), different.identity());
  EXPECT_THROW(normalized_error(sim.graph, other), Error);
}

TEST(NormalizedError, IsForPosesAndWhatTheySee) {
  Registry registry;
  Graph point;
  point.add_variable(registry.variable_type("VERTEX_XY"), 0, std::vector<double>{1.0, 2.0});
  Graph mixed;
  mixed.add_variable(registry.variable_type("VERTEX_SE2"), 1, std::vector<double>{1.0, 2.0, 0.0});
  mixed.add_variable(registry.variable_type("VERTEX_SE3:QUAT"), 0,
                     std::vector<double>{1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0});
  for (const Graph* graph : {&point, &mixed}) {
    try {
      normalized_error(*graph, *graph);
      FAIL() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      EXPECT_THAT(error.what(), HasSubstr(graph->describe_variable(graph->variable_count() - 1)));
    }
  }
  EXPECT_EQ(normalized_error(Graph(), Graph()).dof, 0);
}

TEST(EvenlySpread, AllOfFewAndFortyOfMany) {
  std::vector<Id> ids(40);
  std::iota(ids.begin(), ids.end(), Id{100});
  EXPECT_EQ(evenly_spread(ids), ids);
  ids.resize(4000);
  std::iota(ids.begin(), ids.end(), Id{0});
  const std::vector<Id> some = evenly_spread(ids);
  ASSERT_EQ(some.size(), 40U);
  for (std::size_t k = 0; k < some.size(); ++k) EXPECT_EQ(some[k], 100 * static_cast<Id>(k) + 99);
  EXPECT_TRUE(evenly_spread({}).empty());
}

}  // namespace
}  // namespace cairn::test
