// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/normal_equations.hpp"
#include "cairn/solve/optimizer.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/plugin/registry.hpp"
#include "support/block_systems.hpp"
#include "support/components.hpp"
#include "support/sample_graphs.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// A loss that switches every factor off whose residual is not small.
class Blind final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = std::min(s[k], 1e-9);
      if (!weight.empty()) weight[k] = s[k] < 1e-9 ? 1.0 : 0.0;
    }
  }
  double second_derivative(double) const override { return 0.0; }
};

class NormalEquationsTest : public testing::TestWithParam<std::string> {
 protected:
  Registry registry_;
  std::unique_ptr<LinearSolver> solver_ = registry_.make<LinearSolver>(GetParam());
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(NormalEquationsTest);
INSTANTIATE_TEST_SUITE_P(Registered, NormalEquationsTest,
                         testing::ValuesIn(Registry().names("linear_solver")), test_name);

TEST_P(NormalEquationsTest, SolvesForTheStep) {
  Graph graph = poses_and_points(12, 0.05);
  NormalEquations equations(graph, *solver_);
  equations.linearize(graph.values());
  ASSERT_TRUE(equations.factorize().ok);
  std::vector<double> step(equations.size()), product(equations.size());
  equations.solve(step);
  equations.H().multiply(step, product);
  // An iterative solver says itself how far off it is.
  double length = 0.0;
  for (const double g : equations.g()) length += g * g;
  EXPECT_LE(solver_->stats().relative_residual, 1e-10);
  const double off = std::max(1e-7, solver_->stats().relative_residual * std::sqrt(length));
  for (std::size_t k = 0; k < step.size(); ++k) EXPECT_NEAR(product[k], equations.g()[k], off);
}

TEST_P(NormalEquationsTest, DampsWithoutTouchingH) {
  Graph graph = poses_and_points(12, 0.05);
  NormalEquations equations(graph, *solver_);
  equations.linearize(graph.values());
  const Eigen::MatrixXd before = dense(equations.H());
  std::vector<double> damping(equations.size());
  for (std::size_t k = 0; k < damping.size(); ++k) damping[k] = 1.0 + static_cast<double>(k);
  ASSERT_TRUE(equations.factorize_damped(damping).ok);
  EXPECT_EQ(dense(equations.H()), before);

  Eigen::MatrixXd damped = before;
  damped.diagonal() += Eigen::Map<Eigen::VectorXd>(damping.data(), equations.size());
  Eigen::VectorXd step(equations.size());
  equations.solve({step.data(), damping.size()});
  const Eigen::Map<const Eigen::VectorXd> g(equations.g().data(), equations.size());
  EXPECT_LE((damped * step - g).norm(), 1e-9 * g.norm());
}

TEST_P(NormalEquationsTest, FindsNoFreeDirectionInAProperGraph) {
  for (const int poses : {3, 30, 300}) {
    Graph graph = ring_of_poses(poses, 0.05);
    NormalEquations equations(graph, *solver_);
    equations.linearize(graph.values());
    EXPECT_EQ(equations.free_directions(), 0) << poses;
  }
}

TEST_P(NormalEquationsTest, ExplainsAGraphHeldByAPointAlone) {
  Graph graph = held_by_a_point();
  NormalEquations equations(graph, *solver_);
  equations.linearize(graph.values());
  EXPECT_EQ(equations.free_directions(), 1) << "it may turn about the point";
  const std::string text =
      equations.explain({.ok = false, .failed_block = equations.linearizer().block_of(2)});
  EXPECT_THAT(text, HasSubstr("VERTEX_SE2 2"));
  EXPECT_THAT(text, HasSubstr("1 gauge freedom is likely"));
  EXPECT_THAT(text, HasSubstr("only VERTEX_XY 1000 is constant"));
}

TEST_P(NormalEquationsTest, ExplainsVariablesWithoutWeight) {
  Graph graph = ring_of_poses(6, 0.1);
  graph.set_loss(std::make_shared<Blind>());
  NormalEquations equations(graph, *solver_);
  equations.linearize(graph.values());
  const Factorization factorization = equations.factorize();
  ASSERT_FALSE(factorization.ok);
  const std::string text = equations.explain(factorization);
  EXPECT_THAT(text, HasSubstr("VERTEX_SE2"));
  EXPECT_THAT(text, HasSubstr("15 gauge freedoms are likely"));
  EXPECT_THAT(text, HasSubstr("has any weight"));
}

TEST_P(NormalEquationsTest, HasNothingToSolveWhereEverythingIsHeld) {
  Graph graph = everything_held();
  NormalEquations equations(graph, *solver_);
  EXPECT_EQ(equations.size(), 0);
  EXPECT_NEAR(equations.chi2(graph.values()), chi2_of(graph), 1e-12 * chi2_of(graph));
}

class FreeGaugeTest : public testing::TestWithParam<std::string> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(FreeGaugeTest);
INSTANTIATE_TEST_SUITE_P(Registered, FreeGaugeTest,
                         testing::Values("gauss_newton", "levenberg_marquardt", "dogleg"),
                         test_name);

TEST_P(FreeGaugeTest, IsAnAnswerNotACrash) {
  Registry registry;
  if (!registry.has("optimizer", GetParam())) GTEST_SKIP() << GetParam() << " is not there";
  for (const std::string& solver : registry.names("linear_solver")) {
    SCOPED_TRACE(solver);
    Graph graph = held_by_a_point();
    const Summary summary =
        registry.make<Optimizer>(ComponentSpec{GetParam(), {{"linear_solver", solver}}})
            ->optimize(graph);
    EXPECT_LE(summary.final_chi2, summary.initial_chi2);
    EXPECT_NEAR(chi2_of(graph), summary.final_chi2, 1e-12 * summary.initial_chi2);
    if (summary.status == Status::not_positive_definite) {
      EXPECT_THAT(summary.notes, Contains(HasSubstr("1 gauge freedom is likely")));
    }
    if (GetParam() != "gauss_newton") {
      EXPECT_EQ(summary.status, Status::converged) << "damping sees to it";
    }
  }
}

// Near the minimum g is small, and what rounding leaves of it in the free direction, divided by the
// nearly zero pivot of a preconditioner, is as large as the step.
TEST_P(FreeGaugeTest, IsNoObstacleToConjugateGradients) {
  Registry registry;
  if (!registry.has("optimizer", GetParam()) || !registry.has("linear_solver", "pcg") ||
      !registry.has("linear_solver", "block_cholesky"))
    GTEST_SKIP();
  const auto optimize = [&](int poses, const std::string& solver) {
    Graph graph = held_by_a_point(poses);
    return registry.make<Optimizer>(ComponentSpec{GetParam(), {{"linear_solver", solver}}})
        ->optimize(graph);
  };
  for (int poses = 8; poses < 48; ++poses) {
    const Summary expected = optimize(poses, "block_cholesky");
    for (const char* preconditioner : {"incomplete_cholesky", "block_jacobi", "subgraph"}) {
      SCOPED_TRACE(testing::Message() << poses << " poses, " << preconditioner);
      const Summary summary = optimize(poses, std::string("pcg:preconditioner=") + preconditioner);
      EXPECT_EQ(summary.status, Status::converged);
      EXPECT_LE(summary.final_chi2, expected.final_chi2 * (1.0 + 1e-9));
    }
  }
}

TEST_P(FreeGaugeTest, NamesTheVariableWhereNothingHasWeight) {
  Registry registry;
  if (!registry.has("optimizer", GetParam()) || !registry.has("linear_solver", "eigen"))
    GTEST_SKIP();
  Graph graph = ring_of_poses(6, 0.1);
  graph.set_loss(std::make_shared<Blind>());
  const Summary summary =
      registry.make<Optimizer>(ComponentSpec{GetParam(), {{"linear_solver", "eigen"}}})
          ->optimize(graph);
  if (GetParam() == "gauss_newton") {
    EXPECT_EQ(summary.status, Status::not_positive_definite);
    EXPECT_THAT(
        summary.notes,
        Contains(HasSubstr("H is not positive definite: the factorisation stopped at VERTEX_SE2")));
  } else {
    EXPECT_EQ(summary.status, Status::converged) << "chi2 is flat there";
  }
}

}  // namespace
}  // namespace cairn::test
