// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/connectivity.hpp"

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Edge = FiedlerSolver::Edge;
using testing::HasSubstr;
using testing::ThrowsMessage;

MatrixXd laplacian(int nodes, const std::vector<Edge>& edges, const std::vector<double>& weights) {
  MatrixXd L = MatrixXd::Zero(nodes, nodes);
  for (std::size_t k = 0; k < edges.size(); ++k) {
    VectorXd e = VectorXd::Zero(nodes);
    e[edges[k][0]] = 1.0;
    e[edges[k][1]] = -1.0;
    L += weights[k] * e * e.transpose();
  }
  return L;
}

class AlgebraicConnectivity : public testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("linear_solver", "block_cholesky");
    solver_ = registry_.make<LinearSolver>("block_cholesky");
  }
  /// The eigenvalue and the residual of the eigenvector, against the dense Laplacian.
  void expect_dense(FiedlerSolver& fiedler, int nodes, const std::vector<double>& weights) {
    const MatrixXd L = laplacian(nodes, {fiedler.edges().begin(), fiedler.edges().end()}, weights);
    const double expected = eigenvalues_of(L)[1];
    const FiedlerPair& pair = fiedler.solve(weights);
    EXPECT_NEAR(pair.value, expected, 1e-9 * expected + 1e-13 * L.norm());
    const Eigen::Map<const VectorXd> v(pair.vector.data(), nodes);
    EXPECT_NEAR(v.norm(), 1.0, 1e-12);
    EXPECT_NEAR(v.sum(), 0.0, 1e-9);
    EXPECT_LT((L * v - pair.value * v).norm(), 1e-3 * expected + 1e-12 * L.norm());
  }
  std::vector<Edge> ring(int nodes) {
    std::vector<Edge> edges;
    for (int k = 0; k < nodes; ++k) edges.push_back({k, (k + 1) % nodes});
    return edges;
  }

  Registry registry_;
  std::unique_ptr<LinearSolver> solver_;
};

TEST_F(AlgebraicConnectivity, IsTheSecondSmallestEigenvalue) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Draw draw(seed);
    const int nodes = 3 + draw.integer(80);
    std::vector<Edge> edges;
    for (int k = 1; k < nodes; ++k) edges.push_back({draw.integer(k), k});
    for (int k = 0; k < nodes; ++k) {
      const int a = draw.integer(nodes), b = draw.integer(nodes);
      if (a != b) edges.push_back({a, b});  // some of them twice
    }
    FiedlerSolver fiedler(nodes, edges, *solver_);
    for (int round = 0; round < 4; ++round) {
      std::vector<double> weights;
      for (std::size_t k = 0; k < edges.size(); ++k)
        weights.push_back(std::exp(draw.uniform(-4.0, 4.0)));
      // Not needed to connect:
      for (std::size_t k = static_cast<std::size_t>(nodes) - 1; k < weights.size(); k += 2)
        weights[k] = 0.0;
      expect_dense(fiedler, nodes, weights);
    }
  }
}

TEST_F(AlgebraicConnectivity, OfKnownGraphs) {
  // Two nodes; all pairs (all eigenvalues equal); a ring (double eigenvalues); a long path.
  FiedlerSolver two(2, {{1, 0}}, *solver_);
  EXPECT_NEAR(two.solve(std::vector{3.0}).value, 6.0, 1e-12);
  std::vector<Edge> pairs;
  for (int a = 0; a < 9; ++a) {
    for (int b = 0; b < a; ++b) pairs.push_back({a, b});
  }
  FiedlerSolver complete(9, pairs, *solver_);
  expect_dense(complete, 9, std::vector<double>(pairs.size(), 2.0));
  EXPECT_NEAR(complete.solve(std::vector<double>(pairs.size(), 2.0)).value, 18.0, 1e-10);
  constexpr int kLong = 3000;
  FiedlerSolver circle(kLong, ring(kLong), *solver_);
  const auto of = [](double angle) { return 2.0 - 2.0 * std::cos(angle); };
  const double expected = of(2.0 * std::numbers::pi / kLong);
  EXPECT_NEAR(circle.solve(std::vector<double>(kLong, 1.0)).value, expected, 1e-6 * expected);
  std::vector<double> path(kLong, 1.0);
  path.back() = 0.0;
  const double of_path = of(std::numbers::pi / kLong);
  EXPECT_NEAR(circle.solve(path).value, of_path, 1e-6 * of_path);
}

/// A vector of one set of weights bounds all others: what the bounds of the relaxation rest on.
TEST_F(AlgebraicConnectivity, ItsVectorBoundsThatOfOtherWeights) {
  Draw draw(5);
  const std::vector<Edge> edges = ring(20);
  FiedlerSolver fiedler(20, edges, *solver_);
  const auto weights = [&] {
    std::vector<double> w;
    for (int k = 0; k < 20; ++k) w.push_back(draw.uniform(0.1, 2.0));
    return w;
  };
  for (int round = 0; round < 20; ++round) {
    const VectorXd v = VectorXd::Map(fiedler.solve(weights()).vector.data(), 20);
    const std::vector<double> other = weights();
    EXPECT_GE(v.dot(laplacian(20, edges, other) * v), fiedler.solve(other).value * (1.0 - 1e-9));
  }
}

TEST_F(AlgebraicConnectivity, OfSeveralComponentsIsRefused) {
  EXPECT_THAT(
      [&] {
        FiedlerSolver(5, {{0, 1}, {2, 3}, {3, 4}}, *solver_);
      },
      ThrowsMessage<Error>(HasSubstr("2 components")));
  EXPECT_THAT([&] { FiedlerSolver(1, {}, *solver_); },
              ThrowsMessage<Error>(HasSubstr("two poses")));
  FiedlerSolver fiedler(3, {{0, 1}, {1, 2}}, *solver_);
  EXPECT_THAT(
      [&] {
        fiedler.solve(std::vector{1.0, 0.0});
      },
      ThrowsMessage<Error>(HasSubstr("do not connect")));
}

}  // namespace
}  // namespace cairn::test
