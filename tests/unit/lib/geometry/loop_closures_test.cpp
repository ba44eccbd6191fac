// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/loop_closures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/packed.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Ids = std::vector<Id>;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

/// Poses at random, and factors that agree with them.
class Loops : public testing::Test {
 protected:
  explicit Loops(int dimension = 2) : world_(types_of(dimension, registry_)) {}

  void poses(const Ids& ids) {
    for (const Id id : ids) graph_.add(world_.variable(id, world_.random(draw_, 5.0, 2.0)));
  }
  int relate(Id a, Id b, double sigma = 0.1) {
    return relate(a, b, draw_.covariance(world_.tangent(), sigma));
  }
  int relate(Id a, Id b, const MatrixXd& covariance) {
    return graph_.add(world_.edge(a, b, world_.between(state(a), state(b)), covariance));
  }
  std::span<const double> state(Id id) { return graph_.state(graph_.find(id).value()); }

  Registry registry_;
  PoseWorld world_;
  Draw draw_{7};
  Graph graph_;
};

TEST_F(Loops, AreWhatOdometryLeaves) {
  poses({3, 0, 1, 2, 10});  // ids count, not the order in which the poses came
  const int far = relate(0, 3);
  const int first = relate(0, 1), second = relate(2, 1), third = relate(2, 3), last = relate(10, 3);
  const int again = relate(1, 2);
  const LoopClosures found = find_loop_closures(graph_);
  EXPECT_THAT(found.candidates, testing::UnorderedElementsAre(far, testing::AnyOf(second, again)));
  EXPECT_THAT(found.backbone, SizeIs(4));
  EXPECT_THAT(found.backbone, testing::IsSupersetOf({first, third, last}));
  EXPECT_EQ(found.odometry, 4);
  EXPECT_EQ(found.components, 1);
}

/// ln |Ω| of all spanning trees, by brute force; Kruskal's has the largest sum.
TEST_F(Loops, WithoutOdometryTheTreeHasTheLargestInformation) {
  const Ids ids{0, 2, 4, 6, 8, 10};  // ranks follow each other, factors do not
  poses(ids);
  for (const auto& [a, b] : {std::pair{0, 4},
                             {0, 6},
                             {0, 8},
                             {2, 6},
                             {2, 8},
                             {2, 10},
                             {4, 8},
                             {4, 10},
                             {6, 10},
                             {0, 10}})
    relate(a, b, draw_.uniform(0.01, 1.0));
  const auto weight = [&](int f) {
    return log_determinant_of(unpack(graph_.information(f), world_.tangent()));
  };
  double best = -std::numeric_limits<double>::infinity();
  for (int mask = 0; mask < 1 << 10; ++mask) {
    std::vector<int> component{0, 1, 2, 3, 4, 5};
    double sum = 0.0;
    int joined = 0, count = 0;
    for (int f = 0; f < 10; ++f) {
      if ((mask >> f & 1) == 0) continue;
      const int a = component[graph_.factor_variables(f)[0]],
                b = component[graph_.factor_variables(f)[1]];
      ++count;
      joined += a != b;
      std::ranges::replace(component, b, a);
      sum += weight(f);
    }
    if (count == 5 && joined == 5) best = std::max(best, sum);
  }
  const LoopClosures found = find_loop_closures(graph_);
  double sum = 0.0;
  for (const int f : found.backbone) sum += weight(f);
  EXPECT_THAT(found.backbone, SizeIs(5));
  EXPECT_NEAR(sum, best, 1e-9);
  EXPECT_EQ(found.odometry, 0);
}

TEST_F(Loops, OfBrokenOdometryAreNoneThatConnect) {
  poses({0, 1, 2, 3, 4, 5});
  relate(0, 1);
  relate(1, 2);
  relate(3, 4);
  relate(4, 5);
  const int poor = relate(0, 5, 1.0), good = relate(2, 4, 0.001);
  const LoopClosures found = find_loop_closures(graph_);
  EXPECT_THAT(found.candidates, ElementsAre(poor));
  EXPECT_THAT(found.backbone, testing::Contains(good));
  EXPECT_EQ(found.odometry, 4);
}

TEST_F(Loops, AreNoPriorsNoLandmarksNoPartsOfARelativePoseNothingBetweenFixedPoses) {
  poses({0, 1, 2, 3});
  graph_.add_variable(registry_.variable_type("VERTEX_XY"), 9, std::array{1.0, 2.0});
  for (const Id id : {0, 1, 2}) relate(id, id + 1);
  const int loop = relate(0, 2);
  const MatrixXd I3 = MatrixXd::Identity(3, 3), I2 = MatrixXd::Identity(2, 2);
  graph_.add_factor(registry_.factor_type("EDGE_PRIOR_SE2"), std::array{1}, state(1), pack(I3));
  for (const int v : {0, 1, 2}) {
    graph_.add_factor(registry_.factor_type("EDGE_SE2_XY"), std::array{v, 4}, std::array{1.0, 0.5},
                      pack(I2));
  }
  MatrixXd part = I3;
  part(2, 2) = 0.0;
  graph_.add_factor(registry_.factor_type("EDGE_SE2"), std::array{1, 3}, std::array{1.0, 0.5, 0.0},
                    pack(part));
  EXPECT_THAT(find_loop_closures(graph_).candidates, ElementsAre(loop));
  graph_.set_fixed(0);
  EXPECT_THAT(find_loop_closures(graph_).candidates, ElementsAre(loop));
  graph_.set_fixed(2);
  EXPECT_THAT(find_loop_closures(graph_).candidates, IsEmpty());
}

TEST_F(Loops, WithoutThemTheRestDeterminesAll) {
  Ids ids;
  for (Id id = 0; id < 30; ++id) ids.push_back(id);
  poses(ids);
  for (const Id session : {0, 15}) {
    for (int k = 1; k < 15; ++k) relate(session + k, session + draw_.integer(k));
    for (int k = 0; k < 20; ++k) {
      const Id a = draw_.integer(15), b = draw_.integer(15);
      if (a != b) relate(session + a, session + b);
    }
  }
  const LoopClosures found = find_loop_closures(graph_);
  EXPECT_EQ(found.components, 2);
  EXPECT_THAT(found.backbone, SizeIs(28));
  EXPECT_EQ(found.backbone.size() + found.candidates.size(),
            static_cast<std::size_t>(graph_.factor_count()));
  std::vector<bool> leave(graph_.factor_count());
  for (const int f : found.candidates) leave[f] = true;
  graph_.remove(leave, std::vector<bool>(graph_.variable_count()));
  EXPECT_GT(eigenvalues_of(dense_system(graph_).H)[0], 1e-6);
}

// Weights -----------------------------------------------------------------------------------------

double isotropic(const MatrixXd& part) {
  return static_cast<double>(part.rows()) / inverse_of(part).trace();
}

TEST_F(Loops, EdgesOfThePlaneAreWeightedByTheirInformation) {
  poses({0, 1});
  const MatrixXd Sigma = draw_.covariance(3, 0.2), Omega = inverse_of(Sigma);
  const std::array factors{relate(0, 1, Sigma)};
  for (const bool fixed : {false, true}) {  // it is an edge like any other
    graph_.set_fixed(0, fixed);
    graph_.set_fixed(1, fixed);
    const RelativeEdge edge = relative_edges(graph_, factors).front();
    EXPECT_THAT(edge.variables, ElementsAre(0, 1));
    EXPECT_NEAR(edge.rotation, Omega(2, 2), 1e-9 * Omega(2, 2));
    EXPECT_NEAR(edge.translation, isotropic(Omega.topLeftCorner(2, 2)), 1e-9 * edge.translation);
  }
}

TEST_F(Loops, ALossCountsAtTheStates) {
  poses({0, 1});
  const std::array factors{relate(0, 1)};
  const RelativeEdge plain = relative_edges(graph_, factors).front();
  std::vector<double> moved(state(1).begin(), state(1).end());
  moved[0] += 3.0;
  graph_.set_state(1, moved);
  const double s = squared_norms(graph_).front();
  const std::shared_ptr<const Loss> loss = registry_.make<Loss>("huber");
  graph_.set_loss(loss);
  std::array<double, 1> rho{}, weight{};
  loss->evaluate(std::array{s}, rho, weight);
  ASSERT_LT(weight[0], 0.5);
  const RelativeEdge robust = relative_edges(graph_, factors).front();
  EXPECT_NEAR(robust.rotation, weight[0] * plain.rotation, 1e-9 * plain.rotation);
}

/// The tangent is that of the second pose, in whatever numbers the error is.
TEST(LoopsInSpace, EdgesHaveTheSameWeightInEveryMetric) {
  std::vector<RelativeEdge> edges;
  for (const std::string metric : {"logarithm", "g2o", "rotation_vector"}) {
    Registry registry;
    const PoseWorld world(spatial_types(registry, metric));
    Draw draw(3);
    const auto a = world.random(draw, 2.0, 1.0), b = world.random(draw, 2.0, 1.0);
    const MatrixXd Sigma = draw.covariance(6, 0.1);
    Graph graph;
    graph.add(world.variable(0, a));
    graph.add(world.variable(1, b));
    MatrixXd Omega = inverse_of(Sigma);
    if (metric == "g2o") {  // of a quaternion's vector, half of the angle
      Omega.bottomRows(3) *= 2.0;
      Omega.rightCols(3) *= 2.0;
    }
    graph.add_factor(world.types().edge, std::array{0, 1}, world.between(a, b), pack(Omega));
    edges.push_back(relative_edges(graph, std::array{0}).front());
    if (metric == "logarithm") {
      EXPECT_NEAR(edges[0].rotation, isotropic(Omega.bottomRightCorner(3, 3)), 1e-6);
      EXPECT_NEAR(edges[0].translation, isotropic(Omega.topLeftCorner(3, 3)), 1e-6);
    }
    EXPECT_NEAR(edges.back().rotation, edges[0].rotation, 1e-6 * edges[0].rotation) << metric;
  }
}

}  // namespace
}  // namespace cairn::test
