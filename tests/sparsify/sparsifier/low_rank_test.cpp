// SPDX-License-Identifier: BSD-3-Clause
// Factors of fewer rows than a pose has degrees of freedom: parts of a measurement, positions in
// the world, bearings and ranges. Against dense algebra and a numerical minimum.
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "blanket_matrices.hpp"
#include "cairn/graph/packed.hpp"
#include "recovery.hpp"
#include "sparsify/sparsifier/blankets.hpp"
#include "sparsify/sparsifier/world.hpp"
#include "topologies.hpp"
#include "tree.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Gt;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Lt;
using testing::SizeIs;

class LowRank : public testing::TestWithParam<int> {
 protected:
  int dimension() const { return GetParam(); }
  int rows() const { return dimension() == 2 ? 3 : 6; }
  static int rows_of(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology) {
    int sum = 0;
    for (const FactorChoice& choice : topology) sum += blanket.models[choice.front()].size;
    return sum;
  }
  static RecoveryProblem problem(const DenseBlanket& blanket,
                                 const std::vector<FactorChoice>& topology) {
    return project(blanket, Projection::node).problem(blanket, topology);
  }
  static double kld(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology) {
    return FactorDescent({.tolerance = 1e-8, .iterations = 100000}, true)
        .recover(problem(blanket, topology))
        .kld;
  }
  /// The models of some nodes: the whole one, that of the position, that of the orientation.
  static std::vector<int> of_nodes(const DenseBlanket& blanket, const std::vector<int>& nodes) {
    std::vector<int> found;
    for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) {
      if (blanket.models[k].nodes == nodes) found.push_back(k);
    }
    return found;
  }
  /// All poses are seen from 0, which leaves, and some from each other.
  DenseBlanket star(unsigned seed, int poses, bool absolute) {
    World world(dimension(), seed);
    for (Id id = 0; id <= poses; ++id) world.pose(id);
    for (Id id = 1; id <= poses; ++id) world.relate(0, id);
    world.relate(1, 2);
    if (absolute) world.place(0);
    return world.blanket({0}, /*parts=*/true);
  }
};

/// The least KLD of a topology under Ω_k ⪰ 0, by projected gradients with a line search, in units
/// in which each factor's own optimum is the identity.
double least_kld(const RecoveryProblem& problem) {
  const int r = problem.rank;
  std::vector<Matrix> Q, W;
  for (const RecoveryProblem::Factor& factor : problem.factors) {
    const Matrix J = Eigen::Map<const Matrix>(factor.jacobian.data(), factor.size, r);
    Q.push_back(Eigen::SelfAdjointEigenSolver<Matrix>(J * J.transpose()).operatorInverseSqrt() * J);
    W.emplace_back(Matrix::Identity(factor.size, factor.size));
  }
  const auto L = [&](const std::vector<Matrix>& at) {
    Matrix sum = Matrix::Zero(r, r);
    for (std::size_t k = 0; k < Q.size(); ++k) sum += Q[k].transpose() * at[k] * Q[k];
    return sum;
  };
  double value = dense_kld(L(W)), step = 1.0;
  for (int iteration = 0; iteration < 20000; ++iteration) {
    const Matrix inverse = L(W).inverse();
    std::vector<Matrix> next(W.size());
    double change = 0.0, expected = 0.0, there = value;
    for (step *= 2.0; step > 1e-14; step *= 0.5) {
      change = expected = 0.0;
      for (std::size_t k = 0; k < W.size(); ++k) {
        const Matrix I = Matrix::Identity(W[k].rows(), W[k].rows());
        const Matrix gradient = 0.5 * (I - Q[k] * inverse * Q[k].transpose());
        const Eigen::SelfAdjointEigenSolver<Matrix> eigen(W[k] - step * gradient);
        next[k] = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                  eigen.eigenvectors().transpose();
        change += (next[k] - W[k]).squaredNorm();
        expected += gradient.cwiseProduct(next[k] - W[k]).sum();
      }
      const Eigen::LLT<Matrix> llt(L(next));
      if (llt.info() != Eigen::Success) continue;
      there = dense_kld(L(next));
      if (there <= value + 1e-4 * expected) break;
    }
    if (change < 1e-22 || !(there < value)) break;
    W = next;
    value = there;
  }
  return value;
}

// Recovery ----------------------------------------------------------------------------------------

TEST_P(LowRank, EveryRecoveryFindsTheMinimumOfFactorsWithFewerRows) {
  const InteriorPointOptions interior{.recovery = {.tolerance = 1e-7}};
  for (const unsigned seed : {1U, 2U, 3U}) {
    for (const bool absolute : {false, true}) {
      const DenseBlanket blanket = star(seed, 4, absolute);
      MixedParts mixed(TopologyOptions{});
      const std::vector<FactorChoice> topology = mixed.choose(blanket, 5 + (absolute ? 1 : 0));
      std::set<int> sizes;
      for (const FactorChoice& choice : topology) sizes.insert(blanket.models[choice[0]].size);
      ASSERT_THAT(sizes, SizeIs(Gt(1U)));  // not all are whole
      const RecoveryProblem recovery = problem(blanket, topology);
      const double least = least_kld(recovery);
      ASSERT_THAT(least, Gt(1e-3));
      const RecoveryOptions exact{.tolerance = 1e-8, .iterations = 100000};
      EXPECT_THAT(FactorDescent(exact, false).recover(recovery).kld, DoubleNear(least, 2e-6));
      EXPECT_THAT(FactorDescent(exact, true).recover(recovery).kld, DoubleNear(least, 2e-6));
      EXPECT_THAT(InteriorPoint(interior).recover(recovery).kld, DoubleNear(least, 2e-6));
    }
  }
}

// Topology ----------------------------------------------------------------------------------------

TEST_P(LowRank, PartsFollowTheWholeAndAreItsRows) {
  const DenseBlanket blanket = star(5, 3, true);
  const int d = blanket.size(), first = dimension();
  for (const std::vector<int>& nodes : {std::vector<int>{0, 1}, {0, 2}, {1, 2}, {0}, {1}, {2}}) {
    const std::vector<int> models = of_nodes(blanket, nodes);
    ASSERT_THAT(models, SizeIs(3));
    const Matrix whole = jacobian(blanket.models[models[0]], d);
    EXPECT_EQ(whole.rows(), rows());
    EXPECT_EQ(Matrix(jacobian(blanket.models[models[1]], d)), whole.topRows(first));
    EXPECT_EQ(Matrix(jacobian(blanket.models[models[2]], d)), whole.bottomRows(rows() - first));
  }
}

TEST_P(LowRank, MixedTakesAsManyRowsAsThePopulationHasAndNoneTwice) {
  for (const bool absolute : {false, true}) {
    const DenseBlanket blanket = star(6, 5, absolute);
    const int priors = absolute ? 1 : 0;
    const int whole = 10 + 5 * priors;
    double before = 1e300;
    for (int population = 4 + priors; population <= whole; ++population) {
      const std::vector<FactorChoice> chosen =
          MixedParts(TopologyOptions{}).choose(blanket, population);
      EXPECT_TRUE(connects(blanket, chosen));
      EXPECT_EQ(rows_of(blanket, chosen), rows() * population);
      std::set<std::vector<int>> nodes;
      for (const FactorChoice& choice : chosen) nodes.insert(blanket.models[choice[0]].nodes);
      std::set<int> models;
      for (const FactorChoice& choice : chosen) models.insert(choice.front());
      EXPECT_THAT(nodes, SizeIs(chosen.size()));
      EXPECT_THAT(models, SizeIs(chosen.size()));
      const double now = kld(blanket, chosen);
      EXPECT_THAT(now, Lt(before + 1e-6)) << population;
      before = now;
    }
  }
}

/// Λ is made of a tree, the position of one pair and the orientation of another: a whole factor's
/// worth of rows, which no whole factor can be.
TEST_P(LowRank, MixedFindsThePartsThatTheDensePriorIsMadeOf) {
  Draw draw(7);
  int found = 0;
  for (unsigned seed = 10; seed < 20; ++seed) {
    DenseBlanket blanket = star(seed, 4, false);
    const std::vector<FactorChoice> made{{of_nodes(blanket, {0, 1})[0]},
                                         {of_nodes(blanket, {1, 2})[0]},
                                         {of_nodes(blanket, {2, 3})[0]},
                                         {of_nodes(blanket, {0, 3})[1]},
                                         {of_nodes(blanket, {0, 2})[2]}};
    std::vector<Matrix> Omega;
    for (const FactorChoice& choice : made) {
      // So that the tree is the one with the most mutual information.
      const double weight = Omega.size() < 3 ? 100.0 : 10.0;
      Omega.push_back(weight * draw.definite(blanket.models[choice.front()].size));
    }
    set_information(blanket, made, Omega);
    // As many rows as the tree and one whole factor.
    const double exact = kld(blanket, made);
    EXPECT_THAT(exact, DoubleNear(0.0, 1e-6));
    const double mixed = kld(blanket, MixedParts(TopologyOptions{}).choose(blanket, 4));
    // No choice of whole factors is exact.
    const double best = kld(blanket, Exhaustive(ExhaustiveOptions{}).choose(blanket, 4));
    EXPECT_THAT(best, Gt(1e-5));
    found += mixed < 1e-9;
  }
  EXPECT_THAT(found, testing::Ge(7));  // of ten: it is greedy
}

TEST_P(LowRank, MixedGivesSeveralNodesAPriorWhereTheirPositionsWereMeasured) {
  Draw draw(8);
  for (unsigned seed = 30; seed < 34; ++seed) {
    DenseBlanket blanket = star(seed, 4, true);
    std::vector<FactorChoice> made{{of_nodes(blanket, {0, 1})[0]},
                                   {of_nodes(blanket, {1, 2})[0]},
                                   {of_nodes(blanket, {2, 3})[0]}};
    for (int node = 0; node < 4; ++node) made.push_back({of_nodes(blanket, {node})[1]});
    std::vector<Matrix> Omega;
    for (const FactorChoice& choice : made)
      Omega.push_back(draw.definite(blanket.models[choice.front()].size));
    set_information(blanket, made, Omega);
    const auto priors = [&](const std::vector<FactorChoice>& topology) {
      return std::ranges::count_if(topology, [&](const FactorChoice& choice) {
        return blanket.models[choice.front()].nodes.size() == 1;
      });
    };
    const int population = 6;
    const std::vector<FactorChoice> mixed =
        MixedParts(TopologyOptions{}).choose(blanket, population);
    const std::vector<FactorChoice> whole =
        ExpectedDivergence(TopologyOptions{}).choose(blanket, population);
    EXPECT_EQ(priors(whole), 1);
    EXPECT_THAT(priors(mixed), Gt(1));
    EXPECT_THAT(kld(blanket, mixed), Lt(0.5 * kld(blanket, whole)));
  }
}

// Nodes that leave --------------------------------------------------------------------------------

TEST_P(LowRank, APoseWhosePositionIsMeasuredLeavesIfItIsAskedFor) {
  World world(dimension(), 40);
  for (Id id = 0; id < 4; ++id) world.pose(id);
  for (Id id = 1; id < 4; ++id) world.relate(id - 1, id);
  world.locate(3);
  const Sparsification refused = world.removal({3});
  ASSERT_THAT(refused.refused, SizeIs(1));
  EXPECT_THAT(refused.refused[0].reason, HasSubstr("open=reduce"));
  for (const std::string topology : {"ekld", "clt", "mixed"}) {
    const std::string how = "sparsify:open=reduce,topology=" + topology;
    const Sparsification change = world.removal({3}, how);
    EXPECT_THAT(change.refused, IsEmpty());
    // At the end of a chain nothing is lost, and nothing claimed: not where the next one is, but
    // where it has what left it at the end of its arm.
    const Graph sparse = world.without({3}, how);
    EXPECT_EQ(sparse.factor_count(), 3);
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9)) << topology;
  }
}

TEST_P(LowRank, WhatIsLostOfAMeasuredPositionIsTheDivergence) {
  for (const std::string topology : {"clt", "ekld", "mixed", "mi"}) {
    World world(dimension(), 41);
    for (Id id = 0; id < 5; ++id) world.pose(id);
    for (Id id = 1; id < 5; ++id) world.relate(0, id);
    world.relate(1, 2);
    world.locate(0);
    const std::string how = "sparsify:open=reduce,population=tree:1.3,topology=" + topology;
    const Sparsification change = world.removal({0}, how);
    EXPECT_THAT(change.refused, IsEmpty());
    const Graph sparse = world.without({0}, how);
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(change.kld, DoubleNear(dense_divergence(all, left), 1e-6)) << topology;
    EXPECT_THAT(change.kld, Gt(1e-3));
  }
}

// Where a graph has parts of measurements only, its neighbours are left as open as they are.
TEST_P(LowRank, ARelativePositionIsPassedOn) {
  World world(dimension(), 42);
  for (Id id = 0; id < 4; ++id) world.pose(id);
  world.relate(0, 1);
  world.relate(1, 2);
  world.relate(2, 3);
  Matrix information = Matrix::Zero(rows(), rows());
  information.topLeftCorner(dimension(), dimension()) = 20.0 * world.draw().definite(dimension());
  const auto z = world.graph.measurement(1);
  world.graph.set_measurement(1, std::vector<double>(z.begin(), z.end()), pack(information));
  EXPECT_THAT(world.removal({1}).refused, SizeIs(1));
  const std::string how = "sparsify:open=reduce";
  EXPECT_THAT(world.removal({1}, how).refused, IsEmpty());
  const Graph sparse = world.without({1}, how);
  EXPECT_EQ(sparse.factor_count(), 2);
  const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
  EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
}

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, LowRank, testing::Values(2, 3));

// Bearings and ranges -----------------------------------------------------------------------------

TEST(BearingsAndRanges, AreTheModelWhereNoPositionOfALandmarkIsMeasured) {
  World world(2, 50);
  for (Id id = 0; id < 4; ++id) world.pose(id);
  for (Id id = 10; id < 12; ++id) world.landmark(id);
  for (Id id = 1; id < 4; ++id) world.relate(0, id);
  for (Id id = 10; id < 12; ++id) world.bearing_range(0, id);
  EXPECT_THAT(world.refusal(0), IsEmpty());
  for (const std::string topology : {"clt", "ekld", "mixed"}) {
    const std::string how = "sparsify:population=tree:1.5,topology=" + topology;
    const Sparsification change = world.removal({0}, how);
    EXPECT_THAT(change.refused, IsEmpty());
    const Graph sparse = world.without({0}, how);
    int seen = 0;
    for (int f = 0; f < sparse.factor_count(); ++f) {
      seen += sparse.factor_type(f).tag() == "EDGE_BEARING_RANGE_SE2_XY";
      EXPECT_NE(sparse.factor_type(f).tag(), "EDGE_SE2_XY");
    }
    EXPECT_THAT(seen, testing::Ge(2));
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(change.kld, DoubleNear(dense_divergence(all, left), 1e-6)) << topology;
    EXPECT_THAT(change.kld, Gt(1e-3));
  }
  const DenseBlanket blanket = world.blanket({0}, /*parts=*/true);
  std::vector<int> sizes;
  for (const FactorModel& model : blanket.models) {
    if (model.nodes == std::vector<int>{0, 3}) sizes.push_back(model.size);
  }
  EXPECT_THAT(sizes, testing::ElementsAre(2, 1, 1));
}

TEST(BearingsAndRanges, LoseWhatPositionsLose) {
  for (const bool bearings : {false, true}) {
    World world(2, 51);
    for (Id id = 0; id < 3; ++id) world.pose(id);
    world.landmark(10);
    world.relate(0, 1);
    world.relate(1, 2);
    if (bearings) {
      world.bearing_range(2, 10);
    } else {
      world.observe(2, 10);
    }
    const Graph sparse = world.without({2});
    EXPECT_EQ(sparse.factor_count(), 2);
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
  }
}

}  // namespace
}  // namespace cairn::sparsify
