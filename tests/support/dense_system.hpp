// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"

namespace cairn::test {

/// H and g of a graph at its states, whole, and where the rows of each variable are: what sparse
/// and incremental solvers are compared with.
struct DenseSystem {
  struct Rows {
    Eigen::Index first;
    Eigen::Index size;
  };
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  std::map<Id, Rows> rows;  ///< of the variables that are not held

  Eigen::MatrixXd Sigma() const;  ///< H⁻¹
};

DenseSystem dense_system(const Graph& graph, const std::vector<bool>& held);
/// With what holds the gauge held.
DenseSystem dense_system(const Graph& graph);

/// Gauss-Newton with a dense solve, from the graph's states, until the step is nothing: the minimum
/// next to them. Returns the sum of the steps, which is small where they were at it before.
double solve_densely(Graph& graph, int iterations = 30);

}  // namespace cairn::test
