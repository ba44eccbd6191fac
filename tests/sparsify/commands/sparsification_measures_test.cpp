// SPDX-License-Identifier: BSD-3-Clause
// What is said of a sparse graph: its divergence from the whole one, and its errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "sparsify/commands/sparsify_command.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class SparsificationMeasures : public Sparsify {};

/// H of all but the first variable, dense, in the order of the variables.
MatrixXd dense_information(const Graph& graph) {
  std::vector<bool> held(graph.variable_count());
  held[0] = true;
  Linearizer linearizer(graph, held);
  const BlockStructure& structure = linearizer.structure();
  BlockMatrix H(structure);
  VectorXd g(structure.size());
  linearizer.linearize(graph.values(), H, {g.data(), static_cast<std::size_t>(g.size())});
  MatrixXd dense = MatrixXd::Zero(structure.size(), structure.size());
  VectorXd unit = VectorXd::Zero(structure.size()), column(structure.size());
  for (Eigen::Index k = 0; k < dense.cols(); ++k) {
    unit[k] = 1.0;
    H.multiply({unit.data(), static_cast<std::size_t>(unit.size())},
               {column.data(), static_cast<std::size_t>(column.size())});
    dense.col(k) = column;
    unit[k] = 0.0;
  }
  return dense;
}

double log_determinant(const MatrixXd& A) {
  return 2.0 * A.llt().matrixLLT().diagonal().array().log().sum();
}

/// The rotations of a graph's poses but the first, as they turn a tangent into the world.
MatrixXd to_world(const Graph& graph) {
  const int t = graph.type(0).tangent_size(), poses = graph.variable_count() - 1;
  MatrixXd all = MatrixXd::Identity(t * poses, t * poses);
  for (int v = 0; v < poses; ++v) {
    const Eigen::Matrix3d R = pose_of(graph.type(v + 1), graph.state(v + 1)).R;
    if (t == 3) {
      all.block<2, 2>(t * v, t * v) = R.topLeftCorner<2, 2>();
    } else {
      all.block<3, 3>(t * v, t * v) = all.block<3, 3>(t * v + 3, t * v + 3) = R;
    }
  }
  return all;
}

// Against dense algebra.
TEST_F(SparsificationMeasures, TheLossOfTheWholeIsThatOfDenseAlgebra) {
  Registry registry;
  for (const std::string kind : {"manhattan:poses=60", "sphere:turns=4,poses_per_turn=8"}) {
    Graph original = registry.make<Generator>(kind)->generate(registry, 3).graph;
    const auto optimizer = registry.make<Optimizer>("levenberg_marquardt");
    optimizer->optimize(original);
    std::vector<int> nodes;
    for (int v = 1; v + 1 < original.variable_count(); ++v) {
      if (v % 3 != 0) nodes.push_back(v);
    }
    const auto sparsifier = registry.make<Sparsifier>("sparsify:population=tree:1");
    Graph sparse = original.clone();
    apply(sparsifier->remove(original, nodes), sparse);
    optimizer->optimize(sparse);
    const auto solver = registry.make<LinearSolver>("block_cholesky");

    const int t = original.type(0).tangent_size();
    const MatrixXd all = dense_information(original).inverse();
    std::vector<Eigen::Index> rows;
    Graph kept = sparse.clone();  // at the original's states
    for (int v = 1; v < sparse.variable_count(); ++v) {
      const int at = *original.find(sparse.id(v));
      for (int k = 0; k < t; ++k) rows.push_back((at - 1) * t + k);
      kept.set_state(v, original.state(at));
    }
    for (const ComparedAt compared : {ComparedAt::common, ComparedAt::minima}) {
      const SparsificationError error = sparsification_error(original, sparse, *solver, compared);
      const bool common = compared == ComparedAt::common;
      const Graph& linearized = common ? kept : sparse;
      const Graph& other = common ? sparse : kept;
      MatrixXd q = dense_information(linearized), S = all(rows, rows);
      VectorXd mean(q.rows());
      for (int v = 1; v < sparse.variable_count(); ++v) {
        sparse.type(v).local(1, linearized.state(v).data(), other.state(v).data(),
                             mean.data() + (v - 1) * t);
      }
      EXPECT_NEAR(error.mean, 0.5 * mean.dot(q * mean), 1e-6) << kind;
      if (!common) {
        const MatrixXd R = to_world(kept), Q = to_world(sparse);
        S = (R * S * R.transpose()).eval();
        q = (Q * q * Q.transpose()).eval();
      }
      const double covariance = 0.5 * ((q * S).trace() - log_determinant(q) - log_determinant(S) -
                                       static_cast<double>(q.rows()));
      EXPECT_NEAR(error.covariance, covariance, 1e-6 * (1.0 + covariance)) << kind;
      EXPECT_DOUBLE_EQ(error.kld, error.covariance + error.mean);
      EXPECT_GT(error.covariance, 1e-3);
      EXPECT_NEAR(sparsification_error(original, original, *solver, compared).kld, 0.0, 1e-6);
    }
  }
}

// A node with two neighbours leaves one factor between them, which is exact at the states where it
// was made, however the headings of the two graphs' minima differ.
TEST_F(SparsificationMeasures, NothingIsLostWhereChainsAreMerged) {
  Registry registry;
  const auto solver = registry.make<LinearSolver>("block_cholesky");
  for (const std::string kind : {"manhattan:poses=300", "ellipse3d"}) {
    Graph original = registry.make<Generator>(kind)->generate(registry, 5).graph;
    const auto optimizer = registry.make<Optimizer>("levenberg_marquardt");
    optimizer->optimize(original);
    std::vector<std::set<int>> neighbours(original.variable_count());
    for (int f = 0; f < original.factor_count(); ++f) {
      const auto on = original.factor_variables(f);
      neighbours[on[0]].insert(on[1]);
      neighbours[on[1]].insert(on[0]);
    }
    std::vector<int> nodes;  // no two of them neighbours
    for (int v = 1; v + 1 < original.variable_count(); ++v) {
      if (neighbours[v].size() == 2 && (nodes.empty() || nodes.back() != v - 1)) nodes.push_back(v);
    }
    ASSERT_GE(nodes.size(), 5U) << kind;
    Graph sparse = original.clone();
    apply(registry.make<Sparsifier>("sparsify:resolve=false")->remove(original, nodes), sparse);
    optimizer->optimize(sparse);
    const SparsificationError error = sparsification_error(original, sparse, *solver);
    EXPECT_NEAR(error.covariance, 0.0, 1e-6) << kind;
    EXPECT_GT(error.rmse, 0.0) << kind;
    if (kind.starts_with("manhattan")) {
      EXPECT_GT(sparsification_error(original, sparse, *solver, ComparedAt::minima).covariance,
                1e-4);
    }
  }
}

TEST_F(SparsificationMeasures, ATurnOfTheWholeMapIsNoErrorOnceAligned) {
  Registry registry;
  const auto solver = registry.make<LinearSolver>("block_cholesky");
  for (const std::string kind : {"manhattan:poses=60", "sphere:turns=4,poses_per_turn=8"}) {
    const Graph original = registry.make<Generator>(kind)->generate(registry, 3).graph;
    Graph turned = original.clone();
    const VariableType& type = original.type(0);
    const StateGroup group(type);
    Eigen::VectorXd twist = Eigen::VectorXd::Zero(type.tangent_size());
    twist << 1.0, -2.0, Eigen::VectorXd::Zero(type.tangent_size() - 3), 0.3;
    const std::vector<double> motion = group.exp(twist);
    for (int v = 0; v < turned.variable_count(); ++v)
      turned.set_state(v, group.compose(motion, original.state(v)));
    const SparsificationError error = sparsification_error(original, turned, *solver);
    // Nothing places the graph, and so its place is no difference.
    EXPECT_NEAR(error.rmse, 0.0, 1e-9) << kind;
    EXPECT_NEAR(error.kld, 0.0, 1e-6) << kind;
    // A fixed node does.
    Graph fixed = original.clone(), turned_fixed = turned.clone();
    fixed.set_fixed(0);
    turned_fixed.set_fixed(0);
    const SparsificationError placed = sparsification_error(fixed, turned_fixed, *solver);
    EXPECT_GT(placed.rmse, 1.0) << kind;
    EXPECT_NEAR(placed.rmse_aligned, 0.0, 1e-9) << kind;
    EXPECT_GT(placed.mean, 1.0) << kind;
    EXPECT_NEAR(placed.covariance, 0.0, 1e-6) << kind;
  }
}

}  // namespace
}  // namespace cairn::test
