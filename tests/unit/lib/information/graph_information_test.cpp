// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/information/graph_information.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/information/gaussian.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using ::testing::HasSubstr;
using ::testing::SizeIs;

/// Solvers with determinants and covariances, each by its defaults.
std::vector<std::string> solvers() {
  Registry registry;
  std::vector<std::string> names;
  for (const std::string& name : registry.names(LinearSolver::kKind)) {
    const auto solver = registry.make<LinearSolver>(name);
    if (query<LogDeterminant>(*solver) && query<Marginals>(*solver)) names.push_back(name);
  }
  return names;
}

class GraphInformation : public testing::TestWithParam<std::string> {
 protected:
  Graph simulate(const std::string& generator) {
    return registry_.make<Generator>(generator)->generate(registry_, 5).graph;
  }
  std::vector<Graph> graphs() {
    std::vector<Graph> all;
    all.push_back(ring_of_poses(12, 0.1));
    all.push_back(poses_and_points(8, 0.1));
    if (registry_.has("generator", "manhattan")) {
      all.push_back(simulate("manhattan:poses=80"));
      all.push_back(simulate("sphere:turns=3,poses_per_turn=8"));
    }
    return all;
  }
  /// Rows and columns of these variables in the dense Σ, the constant ones left out.
  static MatrixXd chosen(const Graph& graph, const DenseSystem& dense,
                         const std::vector<int>& variables) {
    std::vector<Eigen::Index> rows;
    for (const int v : variables) {
      const auto at = dense.rows.find(graph.id(v));
      if (at == dense.rows.end()) continue;
      for (Eigen::Index k = 0; k < at->second.size; ++k) rows.push_back(at->second.first + k);
    }
    return dense.Sigma()(rows, rows);
  }
  Registry registry_;
};

TEST_P(GraphInformation, EntropyOfTheWholeIsThatOfDenseAlgebra) {
  for (const Graph& graph : graphs()) {
    const DenseSystem dense = dense_system(graph);
    const auto solver = registry_.make<LinearSolver>(GetParam());
    const GraphEntropy found = entropy(graph, *solver);
    EXPECT_EQ(found.size, dense.H.rows());
    const double expected = log_determinant_of(dense.H);
    EXPECT_NEAR(found.log_determinant, expected, 1e-9 * (1.0 + std::abs(expected)));
    EXPECT_NEAR(found.entropy, entropy(dense.Sigma()), 1e-7 * (1.0 + std::abs(expected)));
  }
}

TEST_P(GraphInformation, OfSomeVariablesIsThatOfTheirDenseCovariance) {
  for (const Graph& graph : graphs()) {
    const DenseSystem dense = dense_system(graph);
    const auto solver = registry_.make<LinearSolver>(GetParam());
    GraphMarginals marginals(graph, *solver);
    ASSERT_TRUE(marginals.factorize().ok);
    const int last = graph.variable_count() - 1;
    const std::vector<int> all{last, 2, 5, 3};
    const MatrixXd S = chosen(graph, dense, all);
    EXPECT_LT((joint_covariance(graph, marginals, all) - S).norm(), 1e-7 * S.norm());
    EXPECT_NEAR(entropy(graph, marginals, all), entropy(S), 1e-6);
    const VariableSets sets[] = {{{last, 2}, {5, 3}}, {{3}, {2}}, {{1}, {last}}};
    const std::vector<double> found = mutual_information(graph, marginals, sets);
    ASSERT_THAT(found, SizeIs(3));
    for (int k = 0; k < 3; ++k) {
      std::vector<int> joint = sets[k].a;
      joint.insert(joint.end(), sets[k].b.begin(), sets[k].b.end());
      const MatrixXd a = chosen(graph, dense, sets[k].a), b = chosen(graph, dense, sets[k].b),
                     ab = chosen(graph, dense, joint);
      const double expected =
          0.5 * (log_determinant_of(a) + log_determinant_of(b) - log_determinant_of(ab));
      EXPECT_NEAR(found[k], expected, 1e-7 * (1.0 + expected));
      EXPECT_GT(found[k], 1e-6);
      EXPECT_NEAR(conditional_entropy(graph, marginals, sets[k].a, sets[k].b) + entropy(b),
                  entropy(ab), 1e-6);
    }
  }
}

// The whole by its parts: H(all) of the joint covariance is that of the determinant.
TEST_P(GraphInformation, AllVariablesHaveTheEntropyOfTheWhole) {
  const Graph graph = ring_of_poses(9, 0.1);
  const auto solver = registry_.make<LinearSolver>(GetParam());
  const double whole = entropy(graph, *solver).entropy;
  GraphMarginals marginals(graph, *solver);
  ASSERT_TRUE(marginals.factorize().ok);
  std::vector<int> all;
  for (int v = 0; v < graph.variable_count(); ++v) all.push_back(v);
  EXPECT_NEAR(entropy(graph, marginals, all), whole, 1e-7 * (1.0 + std::abs(whole)));
}

TEST_P(GraphInformation, ConstantVariablesHaveNoCoordinates) {
  Graph graph = ring_of_poses(9, 0.1);
  graph.set_fixed(0);
  graph.set_fixed(4);
  const auto solver = registry_.make<LinearSolver>(GetParam());
  GraphMarginals marginals(graph, *solver);
  ASSERT_TRUE(marginals.factorize().ok);
  EXPECT_EQ(joint_covariance(graph, marginals, std::array{0, 4}).size(), 0);
  EXPECT_EQ(entropy(graph, marginals, std::array{4}), 0.0);
  EXPECT_DOUBLE_EQ(entropy(graph, marginals, std::array{4, 2}),
                   entropy(graph, marginals, std::array{2}));
  const VariableSets sets[] = {{{4}, {2}}, {{2, 4}, {7, 0}}, {{2}, {7}}};
  const std::vector<double> found = mutual_information(graph, marginals, sets);
  EXPECT_EQ(found[0], 0.0);
  EXPECT_DOUBLE_EQ(found[1], found[2]);
  EXPECT_DOUBLE_EQ(conditional_entropy(graph, marginals, std::array{2}, std::array{4}),
                   entropy(graph, marginals, std::array{2}));
}

TEST_P(GraphInformation, AMeasurementAddsItsInformationGain) {
  if (!registry_.has("generator", "manhattan")) GTEST_SKIP() << "there is no 'manhattan'";
  Graph graph = simulate("manhattan:poses=60");
  const auto solver = registry_.make<LinearSolver>(GetParam());
  const double before = entropy(graph, *solver).entropy;
  GraphMarginals marginals(graph, *solver);
  ASSERT_TRUE(marginals.factorize().ok);
  const MatrixXd S = joint_covariance(graph, marginals, std::array{10, 50});
  const auto edge = registry_.factor_type("EDGE_SE2");
  const std::vector<double> information{50, 0, 0, 80, 0, 200};
  graph.add_factor(edge, std::array{10, 50}, std::array{1.0, 0.1, 0.05}, information);
  const double after = entropy(graph, *solver).entropy;
  // The Jacobian of the factor's residual, whitened: the noise is I.
  MatrixXd J_a(3, 3), J_b(3, 3);
  Eigen::Vector3d r;
  const double* states[] = {graph.state(10).data(), graph.state(50).data()};
  double* jacobians[] = {J_a.data(), J_b.data()};
  const std::array measurement{1.0, 0.1, 0.05};
  const std::array root{std::sqrt(50.0), 0.0, 0.0, std::sqrt(80.0), 0.0, std::sqrt(200.0)};
  edge->evaluate(states, measurement.data(), root.data(), r.data(), jacobians);
  MatrixXd J(3, 6);
  J << J_a, J_b;
  EXPECT_NEAR(information_gain(J, S, MatrixXd::Identity(3, 3)), before - after, 1e-6);
  EXPECT_GT(before - after, 0.1);
}

TEST_P(GraphInformation, AGraphWithoutUnknownsHasNoEntropy) {
  const auto solver = registry_.make<LinearSolver>(GetParam());
  const GraphEntropy found = entropy(everything_held(), *solver);
  EXPECT_EQ(found.size, 0);
  EXPECT_EQ(found.entropy, 0.0);
}

TEST_P(GraphInformation, RefusesAVariableThatIsNamedTwice) {
  const Graph graph = ring_of_poses(9, 0.1);
  const auto solver = registry_.make<LinearSolver>(GetParam());
  GraphMarginals marginals(graph, *solver);
  ASSERT_TRUE(marginals.factorize().ok);
  EXPECT_THROW(joint_covariance(graph, marginals, std::array{3, 2, 3}), Error);
  const VariableSets sets[] = {{{3, 2}, {4, 3}}};
  EXPECT_THROW(mutual_information(graph, marginals, sets), Error);
}

// H is singular, but its factorisation may succeed by rounding.
TEST_P(GraphInformation, RefusesAMatrixThatIsSingularToRounding) {
  const auto solver = Registry().make<LinearSolver>(GetParam());
  try {
    entropy(held_by_a_point(), *solver);
    ADD_FAILURE() << "of a singular H";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::numerical);
    EXPECT_THAT(error.what(), HasSubstr("no entropy: H is "));
  }
}

INSTANTIATE_TEST_SUITE_P(Solvers, GraphInformation, testing::ValuesIn(solvers()), test_name);

TEST(GraphInformationRefusal, NamesASolverWithDeterminants) {
  Registry registry;
  if (!registry.has("linear_solver", "pcg")) GTEST_SKIP() << "there is no 'pcg'";
  try {
    entropy(ring_of_poses(5, 0.1), *registry.make<LinearSolver>("pcg"));
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("block_cholesky"));
  }
}

}  // namespace
}  // namespace cairn::test
