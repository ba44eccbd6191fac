// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/jacobian.hpp"

#include <cmath>
#include <memory>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/types/loss.hpp"
#include "support/block_systems.hpp"
#include "support/sample_graphs.hpp"
#include "support/sample_jacobians.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

/// ρ(s) = ln(1 + s), which weighs every residual differently.
class Logarithmic final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = std::log1p(s[k]);
      if (!weight.empty()) weight[k] = 1.0 / (1.0 + s[k]);
    }
  }
  double second_derivative(double s) const override { return -1.0 / ((1.0 + s) * (1.0 + s)); }
};

/// The whitened residuals of all factors at given states, by the factors' positions.
Eigen::VectorXd residuals(const Graph& graph, const Values& values) {
  Eigen::VectorXd all(graph.residual_size());
  Eigen::Index row = 0;
  for (int position = 0; position < graph.factor_count(); ++position) {
    const FactorRef ref = graph.ref(position);
    std::vector<const double*> pools;
    const FactorView view = graph.view(ref.pool, values, pools);
    const FactorType& type = *graph.factor_pools()[ref.pool].type;
    const int arity = type.arity(), n = type.residual_size();
    std::vector<const double*> states;
    for (int a = 0; a < arity; ++a) {
      states.push_back(view.states[a] +
                       std::ptrdiff_t{view.slots[ref.entry * arity + a]} * type.ambient_size(a));
    }
    type.evaluate(states.data(), view.measurements + ref.entry * type.measurement_size(),
                  graph.sqrt_information(position).data(), all.data() + row, nullptr);
    row += n;
  }
  return all;
}

/// dr/dδ by central differences along the retraction: nothing of it comes from the Jacobians.
Eigen::MatrixXd differences(const Graph& graph, const Linearizer& linearizer) {
  const Eigen::Index n = linearizer.structure().size();
  constexpr double kStep = 1e-6;
  Eigen::MatrixXd J(graph.residual_size(), n);
  for (Eigen::Index column = 0; column < n; ++column) {
    const auto moved = [&](double by) {
      std::vector<double> delta(static_cast<std::size_t>(n), 0.0);
      delta[static_cast<std::size_t>(column)] = by;
      Values values;
      linearizer.retract(graph.values(), delta, values);
      return residuals(graph, values);
    };
    J.col(column) = (moved(kStep) - moved(-kStep)) / (2.0 * kStep);
  }
  return J;
}

struct Evaluated {
  Linearizer linearizer;
  JacobianEvaluator evaluator;
  JacobianMatrix J;
  explicit Evaluated(const Graph& graph)
      : linearizer(graph, resolve_gauge(graph).held),
        evaluator(graph, linearizer),
        J(evaluator.structure()) {
    evaluator.evaluate(graph.values(), J);
  }
};

Eigen::Map<const Eigen::VectorXd> residual(const JacobianMatrix& J) {
  return {J.residual().data(), static_cast<Eigen::Index>(J.residual().size())};
}

TEST(JacobianEvaluator, AgreesWithDifferencesOfTheResiduals) {
  Graph graph = poses_and_points(12, 0.05);
  graph.set_fixed(3);
  const Evaluated evaluated(graph);
  EXPECT_EQ(evaluated.J.structure().size(), evaluated.linearizer.structure().size());
  const Eigen::VectorXd r = residuals(graph, graph.values());
  EXPECT_LE((residual(evaluated.J) - r).norm(), 1e-12 * r.norm());
  const Eigen::MatrixXd J = dense(evaluated.J), expected = differences(graph, evaluated.linearizer);
  EXPECT_LE((J - expected).norm(), 1e-7 * expected.norm());
}

TEST(JacobianEvaluator, SquaresToTheNormalEquationsUnderAnyLoss) {
  std::vector<Graph> graphs;
  graphs.push_back(ring_of_poses(30, 0.1, 3));
  graphs.push_back(poses_and_points(12, 0.1));
  graphs.push_back(ring_of_poses(30, 0.1, 3));
  graphs.back().set_loss(std::make_shared<Logarithmic>());
  graphs.push_back(poses_and_points(12, 0.1));
  graphs.back().set_loss(std::make_shared<Logarithmic>());
  graphs.push_back(ring_of_poses(30, 0.1, 3));
  graphs.back().set_loss(std::make_shared<Logarithmic>(), FactorSelector::loops());
  for (const Graph& graph : graphs) {
    Evaluated evaluated(graph);
    BlockMatrix H(evaluated.linearizer.structure());
    Eigen::VectorXd g(H.structure().size());
    evaluated.linearizer.linearize(graph.values(), H,
                                   {g.data(), static_cast<std::size_t>(g.size())});
    const Eigen::MatrixXd J = dense(evaluated.J), whole = dense(H);
    EXPECT_LE((J.transpose() * J - whole).norm(), 1e-13 * whole.norm());
    EXPECT_LE((J.transpose() * residual(evaluated.J) + g).norm(), 1e-12 * g.norm());
  }
}

TEST(JacobianEvaluator, KeepsARowWithoutEntriesWhereEveryVariableIsHeld) {
  Graph graph = ring_of_poses(6, 0.1);
  graph.set_fixed(0);
  graph.set_fixed(1);
  const Evaluated evaluated(graph);
  const JacobianStructure& structure = evaluated.J.structure();
  EXPECT_EQ(structure.block_rows(), graph.factor_count());
  EXPECT_EQ(structure.block_columns(), 4);
  EXPECT_EQ(structure.row_begin()[1] - structure.row_begin()[0], 0) << "poses 0 and 1 are held";
  EXPECT_EQ(structure.row_begin()[2] - structure.row_begin()[1], 1) << "only pose 1 is";
}

TEST(JacobianEvaluator, GivesTheSameBitsForAnyNumberOfThreads) {
  Graph graph = ring_of_poses(900, 0.05);
  graph.set_loss(std::make_shared<Logarithmic>());
  std::vector<double> values, r;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    const Evaluated evaluated(graph);
    const std::vector<double> now(evaluated.J.values().begin(), evaluated.J.values().end());
    const std::vector<double> r_now(evaluated.J.residual().begin(), evaluated.J.residual().end());
    if (count == 1) {
      values = now;
      r = r_now;
    }
    EXPECT_EQ(now, values) << count;
    EXPECT_EQ(r_now, r) << count;
  }
  set_threads(0);
}

TEST(JacobianEvaluator, RefusesAGraphThatHasChangedAndAForeignMatrix) {
  Graph graph = ring_of_poses(6, 0.1);
  const Linearizer linearizer(graph, resolve_gauge(graph).held);
  const JacobianEvaluator evaluator(graph, linearizer), other(graph, linearizer);
  JacobianMatrix J(evaluator.structure()), J_other(other.structure());
  EXPECT_THROW(evaluator.evaluate(graph.values(), J_other), std::logic_error);
  graph.set_fixed(2);
  EXPECT_THROW(evaluator.evaluate(graph.values(), J), std::logic_error);
}

TEST(JacobianMatrix, MultipliesAsItsDenseSelf) {
  for (const NamedStructure& sample : sample_structures()) {
    SCOPED_TRACE(sample.name);
    const JacobianStructure structure = jacobian_structure(sample.structure);
    JacobianMatrix J(structure);
    fill_full_rank(J, 3);
    const Eigen::MatrixXd whole = dense(J);
    const Eigen::VectorXd x = Eigen::VectorXd::Random(whole.cols()),
                          y = Eigen::VectorXd::Random(whole.rows());
    Eigen::VectorXd product(whole.rows()), transposed(whole.cols());
    const auto span = [](auto& v) {
      return std::span(v.data(), static_cast<std::size_t>(v.size()));
    };
    J.multiply(span(x), span(product));
    J.multiply_transposed(span(y), span(transposed));
    EXPECT_LE((product - whole * x).norm(), 1e-13 * product.norm());
    EXPECT_LE((transposed - whole.transpose() * y).norm(), 1e-13 * transposed.norm());
  }
}

TEST(JacobianStructure, RefusesRowsThatDoNotFitTheEntries) {
  EXPECT_THROW(JacobianStructure({3, 3}, {2}, {0, 1}, {0}), std::logic_error);
  EXPECT_THROW(JacobianStructure({3}, {2}, {0, 2}, {0}), std::logic_error);
}

}  // namespace
}  // namespace cairn::test
