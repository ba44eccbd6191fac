// SPDX-License-Identifier: BSD-3-Clause
#include "loop_graphs.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::edges {

Graph random_loops(Registry& registry, int dimension, int poses, int loops, unsigned seed) {
  test::Draw draw(seed);
  const test::PoseWorld world(test::types_of(dimension, registry));
  std::vector<test::PoseWorld::Pose> truth{world.identity()};
  for (int k = 1; k < poses; ++k)
    truth.push_back(world.compose(truth.back(), world.random(draw, 1.0, 0.5)));
  Graph graph;
  for (int k = 0; k < poses; ++k)
    graph.add(world.variable(k, truth[static_cast<std::size_t>(k)], k == 0));
  const auto relate = [&](int a, int b) {
    const Eigen::MatrixXd covariance = draw.covariance(world.tangent(), 0.02);
    const auto exact =
        world.between(truth[static_cast<std::size_t>(a)], truth[static_cast<std::size_t>(b)]);
    graph.add(world.edge(a, b, world.moved(exact, draw.error(covariance)), covariance));
  };
  for (int k = 1; k < poses; ++k) relate(k - 1, k);
  while (graph.factor_count() < poses - 1 + loops) {
    const int a = draw.integer(poses), b = draw.integer(poses);
    if (b > a + 1) relate(a, b);
  }
  test::solve_densely(graph);
  return graph;
}

Graph with_candidates(const Graph& graph, const std::vector<int>& candidates,
                      const std::vector<int>& stay) {
  Graph left = graph.clone();
  std::vector<bool> leave(graph.factor_count());
  for (const int f : candidates) leave[f] = !std::ranges::binary_search(stay, f);
  left.remove(leave, std::vector<bool>(graph.variable_count()));
  return left;
}

void for_each_choice(int size, int count,
                     const std::function<void(const std::vector<int>&)>& visit) {
  std::vector<int> choice(static_cast<std::size_t>(count));
  std::iota(choice.begin(), choice.end(), 0);
  for (;;) {
    visit(choice);
    int k = count - 1;
    while (k >= 0 && choice[static_cast<std::size_t>(k)] == size - count + k) --k;
    if (k < 0) return;
    ++choice[static_cast<std::size_t>(k)];
    for (int j = k + 1; j < count; ++j)
      choice[static_cast<std::size_t>(j)] = choice[static_cast<std::size_t>(j) - 1] + 1;
  }
}

std::vector<int> at(const std::vector<int>& candidates, const std::vector<int>& numbers) {
  std::vector<int> factors;
  for (const int k : numbers) factors.push_back(candidates[static_cast<std::size_t>(k)]);
  return factors;
}

std::vector<int> all_factors(const Graph& graph) {
  std::vector<int> all(static_cast<std::size_t>(graph.factor_count()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

Eigen::MatrixXd dense_laplacian(const Graph& graph, const std::vector<RelativeEdge>& edges,
                                EdgeWeight weight) {
  const auto n = graph.variable_count();
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(n, n);
  for (const RelativeEdge& edge : edges) {
    const auto [a, b] = edge.variables;
    const double w = edge.weight(weight);
    L(a, a) += w;
    L(b, b) += w;
    L(a, b) -= w;
    L(b, a) -= w;
  }
  return L;
}

double dense_connectivity(const Graph& graph, const std::vector<RelativeEdge>& edges,
                          EdgeWeight weight) {
  return test::eigenvalues_of(dense_laplacian(graph, edges, weight))[1];
}

}  // namespace cairn::edges
