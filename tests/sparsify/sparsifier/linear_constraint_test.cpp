// SPDX-License-Identifier: BSD-3-Clause
// Generic linear constraints against differences, dense algebra and the definition of a tree's.
#include "cairn/geometry/linear_constraint.hpp"

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "blanket_matrices.hpp"
#include "cairn/evaluation/graph_divergence.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "recovery.hpp"
#include "sparsify/sparsifier/world.hpp"
#include "support/dense_system.hpp"
#include "topologies.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Each;
using testing::Gt;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Lt;

constexpr const char* kDense = "sparsify:topology=glc";

std::vector<std::string> tags(const Graph& graph) {
  std::vector<std::string> all;
  for (int f = 0; f < graph.factor_count(); ++f) all.emplace_back(graph.factor_type(f).tag());
  return all;
}

/// The derivative of every factor's residual by central differences, beside its own.
double derivatives_apart(const Graph& graph) {
  constexpr double h = 1e-6;
  double worst = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorType& type = graph.factor_type(f);
    const int m = type.residual_size();
    std::vector<std::vector<double>> states;
    for (const int v : graph.factor_variables(f))
      states.emplace_back(graph.state(v).begin(), graph.state(v).end());
    std::vector<Matrix> J;
    std::vector<double*> out;
    for (int k = 0; k < type.arity(); ++k) J.emplace_back(m, type.tangent_size(k));
    for (Matrix& block : J) out.push_back(block.data());
    const auto residual = [&](double* const* jacobians) {
      std::vector<const double*> x;
      for (const std::vector<double>& state : states) x.push_back(state.data());
      Vector r(m);
      type.evaluate(x.data(), graph.measurement(f).data(), graph.sqrt_information(f).data(),
                    r.data(), jacobians);
      return r;
    };
    residual(out.data());
    for (int k = 0; k < type.arity(); ++k) {
      const VariableType& variable = graph.type(graph.factor_variables(f)[k]);
      const std::vector<double> at = states[k];
      for (int c = 0; c < type.tangent_size(k); ++c) {
        const auto moved = [&](double step) {
          Vector delta = Vector::Zero(type.tangent_size(k));
          delta[c] = step;
          const std::int64_t offset = 0;
          variable.retract(1, at.data(), &offset, delta.data(), states[k].data());
          return residual(nullptr);
        };
        const Vector column = (moved(h) - moved(-h)) / (2.0 * h);
        worst = std::max(worst, (column - J[k].col(c)).norm() / (1.0 + column.norm()));
        states[k] = at;
      }
    }
  }
  return worst;
}

/// Moves every variable at random, the first one of them by a half turn less `margin` as well.
void disturb(Graph& graph, Draw& draw, double size, double margin) {
  for (int v = 0; v < graph.variable_count(); ++v) {
    const VariableType& type = graph.type(v);
    Vector delta = size * draw.matrix(type.tangent_size(), 1);
    if (v == 0 && margin > 0.0) {
      delta.setZero();
      delta[type.tangent_size() - 1] = std::numbers::pi - margin;
    }
    std::vector<double> x(graph.state(v).begin(), graph.state(v).end());
    const std::int64_t offset = 0;
    type.retract(1, x.data(), &offset, delta.data(), x.data());
    graph.set_state(v, x);
  }
}

/// A star of poses about 0 with loops and a landmark: all but 0 are its blanket.
void add_star(World& world, bool landmark, bool absolute) {
  for (Id id = 0; id < 5; ++id) world.pose(id);
  for (Id id = 1; id < 5; ++id) world.relate(0, id);
  world.relate(1, 2);
  world.relate(4, 3);
  if (landmark) {
    world.landmark(10);
    world.observe(0, 10);
    world.observe(3, 10);
  }
  if (absolute) world.place(0);
}

class GenericConstraints : public testing::TestWithParam<int> {};

TEST_P(GenericConstraints, DerivativesAreThoseOfDifferences) {
  for (const bool landmark : {false, true}) {
    for (const bool absolute : {false, true}) {
      World world(GetParam(), 80);
      add_star(world, landmark, absolute);
      Graph sparse = world.without({0}, kDense);
      ASSERT_THAT(tags(sparse), Each(std::string(LinearConstraint::kTag)));
      EXPECT_THAT(derivatives_apart(sparse), Lt(1e-7));
      disturb(sparse, world.draw(), 0.5, 0.0);
      EXPECT_THAT(derivatives_apart(sparse), Lt(1e-6));
      disturb(sparse, world.draw(), 0.0, 1e-3);  // beside the cut of the logarithm
      EXPECT_THAT(derivatives_apart(sparse), Lt(1e-5));
    }
  }
}

/// Poses that look in opposite directions: their relative angles are ±π, and a tiny step across
/// must remain one.
TEST_P(GenericConstraints, AHalfTurnBetweenPosesIsAnAngleLikeAnyOther) {
  World world(GetParam(), 81);
  add_star(world, false, false);
  const VariableType& type = world.graph.type(0);
  const StateGroup group(type);
  Vector half = Vector::Zero(type.tangent_size());
  half[type.tangent_size() - 1] = std::numbers::pi;
  Graph turned;
  Vector root = 0.3 * world.draw().matrix(type.tangent_size(), 1);
  for (int v = 0; v < 3; ++v) {
    const auto x = group.compose(group.exp(root), group.exp(v * half + 0.0 * root));
    turned.add_variable(world.graph.type_of(0), v, group.normalized(x));
  }
  const auto constraint = std::make_shared<LinearConstraint>(
      LinearConstraint::Nodes{.pose = world.graph.type_of(0), .poses = 3}, 2 * type.tangent_size());
  const double* x[] = {turned.state(0).data(), turned.state(1).data(), turned.state(2).data()};
  const int m = constraint->residual_size();
  const Matrix I = Matrix::Identity(m, m);
  std::vector<double> z = constraint->measurement_at(
      x, std::vector<double>(m), std::vector<double>(I.data(), I.data() + I.size()));
  ASSERT_THAT(constraint->normalize(z.data()), IsEmpty());
  turned.add_factor(constraint, std::vector<int>{0, 1, 2}, z, pack(Matrix::Identity(m, m)));
  EXPECT_THAT(squared_norms(turned)[0], Lt(1e-20));
  for (const double step : {1e-4, -1e-4}) {
    Graph moved = turned.clone();
    Vector delta = Vector::Zero(type.tangent_size());
    delta[type.tangent_size() - 1] = step;
    moved.set_state(1, group.compose(turned.state(1), group.exp(delta)));
    EXPECT_THAT(squared_norms(moved)[0], DoubleNear(step * step, 1e-15));
    EXPECT_THAT(derivatives_apart(moved), Lt(1e-7));
  }
}

TEST_P(GenericConstraints, DoNotChangeWhereTheWholeMapMoves) {
  World world(GetParam(), 82);
  add_star(world, true, false);
  Graph sparse = world.without({0}, kDense);
  disturb(sparse, world.draw(), 0.2, 0.0);
  const double chi2 = squared_norms(sparse)[0];
  const StateGroup group(sparse.type(0));
  const auto motion = group.exp(2.0 * world.draw().matrix(group.tangent_size(), 1));
  const Pose by = pose_of(sparse.type(0), motion);
  for (int v = 0; v < sparse.variable_count(); ++v) {
    if (!is_point(sparse.type(v))) {
      sparse.set_state(v, group.compose(motion, sparse.state(v)));
      continue;
    }
    const Eigen::Vector3d at = by.R * position(sparse.type(v), sparse.state(v)) + by.t;
    sparse.set_state(v, {at.data(), sparse.state(v).size()});
  }
  EXPECT_THAT(chi2, Gt(1.0));
  EXPECT_THAT(squared_norms(sparse)[0], DoubleNear(chi2, 1e-9 * chi2));
}

// The dense one -----------------------------------------------------------------------------------

/// The Schur complement of the whole graph is the oracle, at the same states.
TEST_P(GenericConstraints, LoseNothing) {
  for (const bool landmark : {false, true}) {
    for (const bool absolute : {false, true}) {
      World world(GetParam(), 83);
      add_star(world, landmark, absolute);
      world.pose(5);
      world.pose(6);
      world.relate(5, 1);
      world.relate(5, 3);
      world.relate(5, 6);
      world.place(2);
      for (const std::vector<Id>& removed : {std::vector<Id>{0}, {0, 5}, {3, 0}, {0, 1, 2}}) {
        const Sparsification change = world.removal(removed, kDense);
        EXPECT_THAT(change.refused, IsEmpty());
        EXPECT_THAT(change.kld, DoubleNear(0.0, 1e-9));
        const Graph sparse = world.without(removed, kDense);
        const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
        EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
      }
    }
  }
}

/// The information of what a landmark tells its observers has a lower rank than they have
/// coordinates, and factors of pairs lose some of it (`ALandmarkLeavesFactorsOfLowerRank`).
TEST_P(GenericConstraints, LoseNothingOfALandmarkThatLeaves) {
  for (const int observers : {2, 3, 5}) {
    World world(GetParam(), 84 + static_cast<unsigned>(observers));
    for (Id id = 0; id < observers; ++id) world.pose(id);
    world.landmark(10);
    for (Id id = 0; id < observers; ++id) world.observe(id, 10);
    world.pose(20);
    world.relate(0, 20);
    const Sparsification change = world.removal({10}, kDense);
    EXPECT_THAT(change.refused, IsEmpty());
    EXPECT_THAT(change.kld, DoubleNear(0.0, 1e-9));
    const Graph sparse = world.without({10}, kDense);
    EXPECT_EQ(sparse.factor_count(), 2);
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
  }
}

/// An absolute blanket of one pose: the end of a chain.
TEST_P(GenericConstraints, LoseNothingOfTheEndOfAChain) {
  World world(GetParam(), 91);
  for (Id id = 0; id < 3; ++id) world.pose(id);
  for (Id id = 1; id < 3; ++id) world.relate(id - 1, id);
  world.place(2);
  const Graph sparse = world.without({2, 1}, kDense);
  EXPECT_THAT(tags(sparse), testing::ElementsAre(LinearConstraint::kTag));
  const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
  EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
}

/// Measurements that contradict each other, so that no blanket is at its own minimum: that is in
/// the constraint's mean, and the whole keeps its minimum.
TEST(DenseConstraints, KeepTheMinimumAndAllInformationOfAGraph) {
  Registry registry;
  for (const char* world : {"manhattan:poses=150", "sphere:turns=6,poses_per_turn=12"}) {
    const Graph graph = solved(registry, world);
    std::vector<int> leaving;
    for (int v = 1; v < graph.variable_count(); ++v) {
      if (v % 3 != 0) leaving.push_back(v);
    }
    const auto solver = registry.make<LinearSolver>("block_cholesky");
    const auto sparsifier = registry.make<Sparsifier>(kDense);
    Graph sparse = graph.clone();
    const Sparsification change = sparsifier->remove(graph, leaving);
    EXPECT_THAT(change.refused, IsEmpty());
    apply(change, sparse);
    const SparsificationError error = sparsification_error(graph, sparse, *solver);
    EXPECT_THAT(error.kld, DoubleNear(0.0, 1e-8)) << world;
    registry.make<Optimizer>("levenberg_marquardt")->optimize(sparse);
    EXPECT_THAT(sparsification_error(graph, sparse, *solver).rmse, Lt(1e-6)) << world;
  }
}

TEST(DenseConstraints, NeedNoTypeOfARelativePose) {
  World world(2, 92);
  for (Id id = 0; id < 3; ++id) world.pose(id);
  for (Id id = 10; id < 13; ++id) world.landmark(id);
  for (Id id = 0; id < 3; ++id) {
    for (Id seen = 10; seen < 13; ++seen) world.observe(id, seen);
  }
  EXPECT_THAT(world.refusal(10),
              HasSubstr("no factor of the graph measures a whole relative pose"));
  const Graph sparse = world.without({10, 11}, kDense);
  EXPECT_EQ(sparse.variable_count(), 4);
  const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
  EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
}

TEST(DenseConstraints, RefuseWhatTheyCannotMeasure) {
  Registry registry;
  using Nodes = LinearConstraint::Nodes;
  const auto pose = registry.variable_type("VERTEX_SE2"),
             point = registry.variable_type("VERTEX_XY");
  EXPECT_THROW(LinearConstraint(Nodes{.pose = pose, .poses = 1}, 1), Error);
  EXPECT_THROW(LinearConstraint(Nodes{.pose = pose, .poses = 2}, 0), Error);
  EXPECT_THROW(LinearConstraint(Nodes{.pose = pose, .poses = 2}, 4), Error);
  EXPECT_THROW(LinearConstraint(Nodes{.pose = point, .poses = 2}, 1), Error);
  EXPECT_THROW(LinearConstraint(Nodes{.pose = pose, .poses = 2, .landmarks = 1}, 1), Error);
  EXPECT_NO_THROW(LinearConstraint(Nodes{.pose = pose, .poses = 1, .absolute_size = 3}, 3));
  World world(2, 93);
  add_star(world, false, false);
  EXPECT_THROW(DenseConstraint().choose(world.blanket({0}), 9), Error);
}

// The tree ----------------------------------------------------------------------------------------

/// The pairwise potential of two nodes: all others marginalised by the pseudoinverse. Of relative
/// measurements this is p(x_j | x_i), since a pose by itself has no information.
Matrix pair_potential(const DenseBlanket& blanket, const std::vector<int>& nodes) {
  const std::vector<int> begin = blanket.offsets();
  std::vector<int> pair, others;
  for (int node = 0; node + 1 < static_cast<int>(begin.size()); ++node) {
    const bool kept = node == nodes[0] || node == nodes[1];
    for (int k = begin[node]; k < begin[node + 1]; ++k) (kept ? pair : others).push_back(k);
  }
  const Matrix L = information(blanket);
  Matrix result = Matrix::Zero(L.rows(), L.cols());
  const Matrix across = L(pair, others);
  const Matrix inverse =
      Matrix(L(others, others)).completeOrthogonalDecomposition().pseudoInverse();
  result(pair, pair) = L(pair, pair) - across * inverse * across.transpose();
  return result;
}

/// GLC's tree is a linear constraint for each edge of the Chow-Liu tree. On two nodes that is a
/// relative measurement with the information that `clt` with `closed_form` finds: Λ̆ is the same.
TEST_P(GenericConstraints, OfATreeAreTheFactorsOfClt) {
  for (const bool landmark : {false, true}) {
    World world(GetParam(), 94);
    add_star(world, landmark, false);
    const DenseBlanket blanket = world.blanket({0});
    const int d = blanket.size();
    const std::vector<FactorChoice> tree = ChowLiuTree(TopologyOptions{}).choose(blanket, 0);
    const RecoveryProblem problem = project(blanket, Projection::node).problem(blanket, tree);
    const RecoveryResult recovered = ClosedForm().recover(problem);
    Matrix of_tree = Matrix::Zero(d, d), of_constraints = of_tree;
    for (std::size_t k = 0; k < tree.size(); ++k) {
      const FactorModel& model = blanket.models[tree[k].front()];
      const Matrix J = jacobian(model, d);
      of_tree += J.transpose() * information(recovered, static_cast<int>(k), model.size) * J;
      of_constraints += pair_potential(blanket, model.nodes);
    }
    EXPECT_THAT(apart(of_tree / of_tree.norm(), of_constraints / of_tree.norm()), Lt(1e-9));
  }
}

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, GenericConstraints, testing::Values(2, 3));

}  // namespace
}  // namespace cairn::sparsify
