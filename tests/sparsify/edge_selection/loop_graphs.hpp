// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::edges {

/// Poses in 2 or 3 dimensions, in a chain with random relative poses, and as many loop closures
/// between random pairs; covariances random, the graph at its minimum, the first pose fixed.
Graph random_loops(Registry& registry, int dimension, int poses, int loops, unsigned seed);

/// The graph with these of its candidates alone.
Graph with_candidates(const Graph& graph, const std::vector<int>& candidates,
                      const std::vector<int>& stay);

/// All choices of `count` of the numbers 0 … size − 1.
void for_each_choice(int size, int count,
                     const std::function<void(const std::vector<int>&)>& visit);
std::vector<int> at(const std::vector<int>& candidates, const std::vector<int>& numbers);

/// Laplacian of the relative factors of a graph, dense, whole.
Eigen::MatrixXd dense_laplacian(const Graph& graph, const std::vector<RelativeEdge>& edges,
                                EdgeWeight weight);
/// Its second smallest eigenvalue.
double dense_connectivity(const Graph& graph, const std::vector<RelativeEdge>& edges,
                          EdgeWeight weight);
std::vector<int> all_factors(const Graph& graph);

}  // namespace cairn::edges
