// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/elimination.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include "cairn/graph/gauge.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "support/dense_system.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::ElementsAre;
using ::testing::SizeIs;

struct RelativePose3 {
  static constexpr std::string_view kTag = "EDGE_SE3:QUAT";
  static constexpr int kResidual = 6, kMeasurement = 7;
  using Variables = std::tuple<Se3, Se3>;
  template <class S>
  static Vector<S, 6> residual(const Vector<S, 7>& a, const Vector<S, 7>& b,
                               const Vector<double, 7>& z) {
    return Se3::log<S>(Se3::between<S>(z.template cast<S>(), Se3::between<S>(a, b)));
  }
};

/// The graph without `ids`, whose information stays.
Graph marginalized(const Graph& whole, const std::vector<Id>& ids, const std::vector<bool>& held) {
  Graph graph = whole.clone();
  std::vector<int> variables;
  std::vector<bool> leaves(graph.variable_count(), false), replaced(graph.factor_count(), false);
  for (const Id id : ids) {
    variables.push_back(*graph.find(id));
    leaves[variables.back()] = true;
  }
  const Elimination elimination = eliminate(graph, variables, held);
  for (const int f : elimination.replaced) replaced[f] = true;
  graph.remove(replaced, leaves);
  for (const Factor& prior : elimination.priors) {
    std::vector<int> on;
    for (const Id id : prior.variables) on.push_back(*graph.find(id));
    graph.add_factor(prior.type, on, prior.measurement, prior.information);
  }
  return graph;
}

/// What stays has the solution and the covariance that it has in the whole problem.
void expect_same_rest(const Graph& whole, const std::vector<bool>& held, const Graph& rest) {
  const test::DenseSystem a = test::dense_system(whole, held), b = test::dense_system(rest);
  const VectorXd delta_a = a.H.ldlt().solve(a.g), delta_b = b.H.ldlt().solve(b.g);
  const MatrixXd Sigma_a = a.Sigma(), Sigma_b = b.Sigma();
  ASSERT_FALSE(b.rows.empty());
  for (const auto& [i, row] : b.rows) {
    ASSERT_TRUE(a.rows.contains(i)) << i;
    const Eigen::Index from = a.rows.at(i).first;
    EXPECT_TRUE(
        delta_a.segment(from, row.size).isApprox(delta_b.segment(row.first, row.size), 1e-8))
        << "solution of " << i;
    for (const auto& [j, column] : b.rows) {
      const MatrixXd block_a = Sigma_a.block(from, a.rows.at(j).first, row.size, column.size);
      const MatrixXd block_b = Sigma_b.block(row.first, column.first, row.size, column.size);
      EXPECT_LT((block_a - block_b).norm(), 1e-8 * Sigma_a.norm()) << i << " and " << j;
    }
  }
}

std::vector<double> unit_information(int n) {
  std::vector<double> packed;
  for (int row = 0; row < n; ++row) {
    for (int column = row; column < n; ++column) packed.push_back(row == column ? 1.0 + row : 0.1);
  }
  return packed;
}

/// A chain in space with one loop; pose 0 is fixed.
Graph chain_in_space(int poses, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto pose = define_variable<Se3>();
  const auto between = define_factor<RelativePose3>();
  const auto random_pose = [&] {
    Vector<double, 6> delta;
    for (double& d : delta) d = uniform(rng);
    const Vector<double, 7> x = Se3::exp<double>(delta);
    return std::vector<double>(x.begin(), x.end());
  };
  Graph graph;
  for (int k = 0; k < poses; ++k) graph.add_variable(pose, k, random_pose());
  for (int k = 1; k < poses; ++k)
    graph.add_factor(between, std::array{k - 1, k}, random_pose(), unit_information(6));
  graph.add_factor(between, std::array{0, poses - 1}, random_pose(), unit_information(6));
  graph.set_fixed(0);
  return graph;
}

TEST(Elimination, LeavesTheRestOfAPlanarGraphAsItWas) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Graph whole = test::random_graph(test::PlanarTypes(), 9, 4, seed);
    const std::vector<bool> held = resolve_gauge(whole).held;
    for (const std::vector<Id>& ids :
         {std::vector<Id>{0}, std::vector<Id>{4}, std::vector<Id>{2, 3}, std::vector<Id>{0, 7, 10},
          std::vector<Id>{9, 10, 11, 12}, std::vector<Id>{1, 2, 3, 4, 5, 6, 7}}) {
      expect_same_rest(whole, held, marginalized(whole, ids, held));
    }
  }
}

TEST(Elimination, LeavesTheRestOfASpatialGraphAsItWas) {
  const Graph whole = chain_in_space(7, 3);
  const std::vector<bool> held = resolve_gauge(whole).held;
  expect_same_rest(whole, held, marginalized(whole, {3}, held));
  expect_same_rest(whole, held, marginalized(whole, {1, 2, 5}, held));
}

TEST(Elimination, AHeldVariableThatLeavesStillHoldsTheRest) {
  const Graph whole = chain_in_space(5, 4);
  const std::vector<bool> held = resolve_gauge(whole).held;
  const Graph rest = marginalized(whole, {0}, held);
  EXPECT_THAT(resolve_gauge(rest).anchored, SizeIs(0));
  expect_same_rest(whole, held, rest);
}

/// Four poses, with nothing that ties them to the world.
Graph chain_of_odometry() {
  test::PlanarTypes types;
  Graph graph;
  for (int k = 0; k < 4; ++k)
    graph.add_variable(types.pose, k, std::array{1.1 * k, 0.1 * k, 0.2 * k});
  for (int k = 1; k < 4; ++k)
    graph.add_factor(types.relative_pose, std::array{k - 1, k}, std::array{1.0, 0.0, 0.1},
                     unit_information(3));
  return graph;
}

TEST(Elimination, AnAnchorThatLeavesStillAnchorsTheRest) {
  const Graph whole = chain_of_odometry();
  const Gauge gauge = resolve_gauge(whole);
  ASSERT_THAT(gauge.anchored, ElementsAre(0));
  const Graph rest = marginalized(whole, {0, 1}, gauge.held);
  EXPECT_THAT(resolve_gauge(rest).anchored, SizeIs(0));
  expect_same_rest(whole, gauge.held, rest);
}

TEST(Elimination, RelativeMeasurementsLeaveARelativePrior) {
  const Graph whole = chain_of_odometry();
  const std::vector<bool> held = resolve_gauge(whole).held;
  const Graph rest = marginalized(whole, {2}, held);
  ASSERT_EQ(rest.factor_count(), 2);
  const FactorType& prior = rest.factor_type(1);
  EXPECT_EQ(prior.tag(), MarginalPrior::kTag);
  EXPECT_EQ(prior.residual_size(), 3);
  EXPECT_EQ(prior.absolute_size(), 0);
  EXPECT_THAT(resolve_gauge(rest).anchored, ElementsAre(0));
  expect_same_rest(whole, held, rest);
}

TEST(Elimination, MakesOnePriorForEachGroup) {
  test::PlanarTypes types;
  Graph whole;
  for (int k = 0; k < 7; ++k) whole.add_variable(types.pose, k, std::array{1.1 * k, 0.0, 0.0});
  for (int k = 1; k < 7; ++k)
    whole.add_factor(types.relative_pose, std::array{k - 1, k}, std::array{1.0, 0.0, 0.1},
                     unit_information(3));
  const Elimination apart =
      eliminate(whole, std::array{1, 5}, std::vector<bool>(whole.variable_count(), false));
  ASSERT_THAT(apart.priors, SizeIs(2));
  EXPECT_THAT(apart.priors[0].variables, ElementsAre(0, 2));
  EXPECT_THAT(apart.priors[1].variables, ElementsAre(4, 6));
  EXPECT_THAT(apart.replaced, ElementsAre(0, 1, 4, 5));
  const Elimination together =
      eliminate(whole, std::array{2, 3, 4}, std::vector<bool>(whole.variable_count(), false));
  ASSERT_THAT(together.priors, SizeIs(1));
  EXPECT_THAT(together.priors[0].variables, ElementsAre(1, 5));
}

TEST(Elimination, WhatIsNotDeterminedDropsOut) {
  // A point seen along one direction only has no say on the pose once it has left.
  test::PlanarTypes types;
  Graph whole;
  whole.add_variable(types.pose, 0, std::array{0.0, 0.0, 0.0});
  whole.add_variable(types.point, 1, std::array{1.0, 2.0});
  whole.add_factor(types.point_seen, std::array{0, 1}, std::array{1.0, 2.1}, unit_information(2));
  EXPECT_THAT(eliminate(whole, std::array{1}, std::vector<bool>(2, false)).priors, SizeIs(0));
}

class Halving final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < rho.size(); ++k) rho[k] = 0.5 * s[k];
    for (double& w : weight) w = 0.5;
  }
  double second_derivative(double) const override { return 0.0; }
};

TEST(Elimination, WeighsByTheLossOnce) {
  Graph whole = test::random_graph(test::PlanarTypes(), 6, 2, 8);
  whole.set_loss(std::make_shared<Halving>());
  const std::vector<bool> held = resolve_gauge(whole).held;
  expect_same_rest(whole, held, marginalized(whole, {1, 2}, held));
}

TEST(MarginalPrior, HasTheDerivativesOfItsResidual) {
  const Graph whole = chain_in_space(4, 9);
  const Elimination made = eliminate(whole, std::array{1, 2}, resolve_gauge(whole).held);
  ASSERT_THAT(made.priors, SizeIs(1));
  const FactorType& prior = *made.priors[0].type;
  const int n = prior.residual_size(), arity = prior.arity();
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> uniform(-0.8, 0.8);
  const auto step = [](const double* x, const Vector<double, 6>& delta) {
    return Se3::retract<double>(Eigen::Map<const Vector<double, 7>>(x), delta);
  };
  std::vector<Vector<double, 7>> x;
  for (const Id id : made.priors[0].variables) {
    Vector<double, 6> away;
    for (double& d : away) d = uniform(rng);
    x.push_back(step(whole.state(*whole.find(id)).data(), away));
  }
  const auto residual = [&](const std::vector<Vector<double, 7>>& at) {
    std::vector<const double*> states;
    for (const auto& state : at) states.push_back(state.data());
    VectorXd r(n);
    prior.evaluate(states.data(), nullptr, made.priors[0].information.data(), r.data(), nullptr);
    return r;
  };
  std::vector<MatrixXd> J(arity, MatrixXd(n, 6));
  std::vector<double*> targets;
  std::vector<const double*> states;
  for (int k = 0; k < arity; ++k) {
    targets.push_back(J[k].data());
    states.push_back(x[k].data());
  }
  VectorXd r(n);
  prior.evaluate(states.data(), nullptr, made.priors[0].information.data(), r.data(),
                 targets.data());
  EXPECT_TRUE(r.isApprox(residual(x)));
  constexpr double kStep = 1e-6;
  for (int k = 0; k < arity; ++k) {
    for (int d = 0; d < 6; ++d) {
      auto forward = x, backward = x;
      forward[k] = step(x[k].data(), kStep * Vector<double, 6>::Unit(d));
      backward[k] = step(x[k].data(), -kStep * Vector<double, 6>::Unit(d));
      const VectorXd numeric = (residual(forward) - residual(backward)) / (2.0 * kStep);
      EXPECT_LT((numeric - J[k].col(d)).norm(), 1e-7 * (1.0 + numeric.norm())) << k << ' ' << d;
    }
  }
}

TEST(MarginalPrior, WhitensByTheInformationThatItIsGiven) {
  test::PlanarTypes types;
  Graph graph;
  graph.add_variable(types.pose, 0, std::array{0.0, 0.0, 0.0});
  const auto type = std::make_shared<MarginalPrior>(
      std::vector<MarginalPrior::Variable>{{types.pose, {0.0, 0.0, 0.0}}},
      LinearResidual{2, 3, {1, 0, 0, 1, 0, 0}, {1.0, 2.0}}, 2);
  graph.add_factor(type, std::array{0}, {}, std::array{4.0, 0.0, 9.0});
  EXPECT_DOUBLE_EQ(squared_norms(graph)[0], 4.0 * 1.0 + 9.0 * 4.0);
  const test::DenseSystem system = test::dense_system(graph, {false});
  EXPECT_DOUBLE_EQ(system.H(0, 0), 4.0);
  EXPECT_DOUBLE_EQ(system.H(1, 1), 9.0);
  EXPECT_DOUBLE_EQ(system.g[1], 18.0);
}

TEST(MarginalPrior, RefusesWhatDoesNotFit) {
  test::PlanarTypes types;
  const std::vector<MarginalPrior::Variable> on = {{types.pose, {0.0, 0.0, 0.0}}};
  EXPECT_THROW(MarginalPrior(on, LinearResidual{1, 2, {1, 0}, {1}}, 0), Error);
  EXPECT_THROW(MarginalPrior(on, LinearResidual{0, 3, {}, {}}, 0), Error);
  EXPECT_THROW(MarginalPrior({{types.pose, {0.0}}}, LinearResidual{1, 3, {1, 0, 0}, {1}}, 0),
               Error);
}

TEST(SquareRoot, DropsWhatRoundingLeft) {
  // Rank 2 of 3, with entries of very different size.
  const MatrixXd J = (MatrixXd(2, 3) << 1e4, -2e4, 1e-3, 3e2, 1e2, -2e-3).finished();
  const MatrixXd H = J.transpose() * J;
  const VectorXd g = J.transpose() * VectorXd::Ones(2), diagonal = H.diagonal();
  const LinearResidual root = square_root({H.data(), 9}, {g.data(), 3}, {diagonal.data(), 3});
  ASSERT_EQ(root.rows, 2);
  const Eigen::Map<const MatrixXd> A(root.A.data(), 2, 3);
  const Eigen::Map<const VectorXd> b(root.b.data(), 2);
  EXPECT_TRUE((A.transpose() * A).isApprox(H, 1e-10));
  EXPECT_TRUE((A.transpose() * b).isApprox(g, 1e-10));
}

}  // namespace
}  // namespace cairn
