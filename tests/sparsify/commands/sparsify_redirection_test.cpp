// SPDX-License-Identifier: BSD-3-Clause
// cairn sparsify --online: factors for nodes that have left are redirected.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "integration/process.hpp"
#include "sparsify/commands/sparsify_command.hpp"

namespace cairn::test {
namespace {

/// A chain in the plane whose factors have these standard deviations, without noise.
Graph chain(Registry& registry, const std::vector<double>& sigmas) {
  Graph graph;
  const auto pose = registry.variable_type("VERTEX_SE2");
  const auto edge = registry.factor_type("EDGE_SE2");
  for (int k = 0; k <= static_cast<int>(std::ssize(sigmas)); ++k)
    graph.add_variable(pose, k, std::vector<double>{1.0 * k, 0.0, 0.0});
  for (int k = 0; k < static_cast<int>(std::ssize(sigmas)); ++k) {
    const double w = 1.0 / (sigmas[k] * sigmas[k]);
    graph.add_factor(edge, std::vector<int>{k, k + 1}, std::vector<double>{1.0, 0.0, 0.0},
                     std::vector<double>{w, 0, 0, w, 0, 10.0 * w});
  }
  return graph;
}

TEST_F(Sparsify, ARedirectedFactorHasTheUncertaintyOfThePath) {
  Registry registry;
  if (!registry.has("variable", "VERTEX_SE2")) GTEST_SKIP() << "no poses in the plane";
  Graph graph = chain(registry, {0.1, 0.1, 0.3, 0.1, 0.1});
  Redirection redirection({.inflation = 1.0});
  const int nodes[] = {1, 2};
  redirection.leave(graph, nodes);
  // The path over the certain factors, though the other side is nearer.
  EXPECT_EQ(redirection.anchor(2), 0);
  const Factor late{
      graph.type_of_factor(0), {2, 5}, {3.0, 0.0, 0.0}, {400.0, 0.0, 0.0, 500.0, 0.0, 3000.0}};
  const Factor moved = redirection.redirect(late).value();
  EXPECT_THAT(moved.variables, testing::ElementsAre(0, 5));
  // The covariance of pose 5 with pose 0 known, through both: the path and the factor itself, or
  // what they became.
  const auto covariance = [&](const Graph& of, int v) {
    const auto solver = registry.make<LinearSolver>("block_cholesky");
    GraphMarginals marginals(of, *solver);
    EXPECT_TRUE(marginals.factorize().ok);
    const std::pair<int, int> pair[] = {{v, v}};
    return marginals.blocks(pair);
  };
  Graph path = chain(registry, {0.1, 0.1});
  path.set_fixed(0);
  path.add_variable(graph.type_of(0), 5, graph.state(5));
  path.add_factor(late.type, std::vector<int>{2, 3}, late.measurement, late.information);
  Graph direct;
  direct.add_variable(graph.type_of(0), 0, graph.state(0));
  direct.add_variable(graph.type_of(0), 5, graph.state(5));
  direct.set_fixed(0);
  direct.add_factor(moved.type, std::vector<int>{0, 1}, moved.measurement, moved.information);
  const std::vector<double> expected = covariance(path, 3), found = covariance(direct, 1);
  for (std::size_t k = 0; k < expected.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-12);
  // By default the path counts twice: the rest is the factor's own.
  Redirection inflated;
  inflated.leave(graph, nodes);
  const MotionGroup motions(graph.type_of(0));
  const double once = motions.of_factor(moved, 0).covariance[0],
               twice = motions.of_factor(inflated.redirect(late).value(), 0).covariance[0];
  EXPECT_NEAR(twice - once, 0.02, 1e-12);  // two factors of 0.1 m
}

TEST_F(Sparsify, NothingIsRedirectedToANodeThatMayLeaveWhereAnotherIs) {
  Registry registry;
  if (!registry.has("variable", "VERTEX_SE2")) GTEST_SKIP() << "no poses in the plane";
  const Graph graph = chain(registry, {0.1, 0.1, 0.1, 0.1});
  using To = RedirectionRule::To;
  const int leaves[] = {2, 3}, others[] = {4}, all_others[] = {0, 1, 4};
  const auto anchor = [&](RedirectionRule rule, Id of, std::span<const int> undecided) {
    Redirection redirection(rule);
    redirection.leave(graph, leaves, undecided);
    return redirection.anchor(of);
  };
  for (const To to : {To::path, To::place, To::order, To::next})
    EXPECT_EQ(anchor({to}, 3, others), 1) << static_cast<int>(to);
  for (const To to : {To::path, To::place, To::order, To::next})
    EXPECT_EQ(anchor({to}, 3, all_others), 4) << static_cast<int>(to);
  // Nodes 1 and 3 are equally near to 2.
  const int one[] = {2};
  for (const bool newer : {false, true}) {
    Redirection redirection({To::order, newer});
    redirection.leave(graph, one);
    EXPECT_EQ(redirection.anchor(2), newer ? 3 : 1);
  }
  Redirection next({To::next});
  next.leave(graph, one);
  EXPECT_EQ(next.anchor(2), 3);
}

TEST_F(Sparsify, AFactorForANodeThatHasLeftSaysTheSameOfAnother) {
  Registry registry;
  Graph graph =
      registry.make<Generator>("sphere:turns=3,poses_per_turn=8")->generate(registry, 1).graph;
  Redirection redirection;
  const int leaving[] = {3, 4, 9};
  redirection.leave(graph, leaving);
  EXPECT_TRUE(redirection.has(graph.id(3)));
  EXPECT_FALSE(redirection.has(graph.id(5)));
  const auto type = graph.type_of_factor(0);
  const auto information = graph.information(0);
  for (const auto& [a, b] : std::vector<std::pair<int, int>>{{3, 20}, {20, 3}, {4, 9}}) {
    // What it measures is where the two are: so it must fit wherever it goes.
    const VariableType& pose = graph.type(a);
    std::vector<double> back(pose.ambient_size()), z(pose.ambient_size());
    pose.lie_group()->inverse(graph.state(a).data(), back.data());
    pose.lie_group()->compose(back.data(), graph.state(b).data(), z.data());
    const auto moved = redirection.redirect(
        {type, {graph.id(a), graph.id(b)}, z, {information.begin(), information.end()}});
    ASSERT_TRUE(moved);
    for (const Id id : moved->variables) EXPECT_FALSE(redirection.has(id));
    Graph check = graph.clone();
    std::vector<int> on;
    for (const Id id : moved->variables) on.push_back(*check.find(id));
    const int added = check.add_factor(type, on, moved->measurement, moved->information);
    EXPECT_NEAR(squared_norms(check)[added], 0.0, 1e-12);
  }
  const auto untouched = redirection.redirect({type,
                                               {graph.id(6), graph.id(7)},
                                               {0, 0, 0, 0, 0, 0, 1},
                                               {information.begin(), information.end()}});
  EXPECT_THAT(untouched->variables, testing::ElementsAre(graph.id(6), graph.id(7)));
  // Where the anchor leaves as well, its followers go on to the next.
  const Id first = redirection.anchor(graph.id(3));
  const int anchor[] = {*graph.find(first)};
  redirection.leave(graph, anchor);
  EXPECT_NE(redirection.anchor(graph.id(3)), first);
  const Id next = redirection.anchor(graph.id(3));
  const std::vector<double> state = redirection.state(graph.id(3), graph.state(*graph.find(next)));
  std::vector<double> apart(graph.type(3).tangent_size());
  graph.type(3).local(1, graph.state(3).data(), state.data(), apart.data());
  EXPECT_THAT(apart, testing::Each(testing::DoubleNear(0.0, 1e-9)));
}

}  // namespace
}  // namespace cairn::test
