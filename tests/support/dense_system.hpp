// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/linearizer.hpp"
#include "support/block_systems.hpp"

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

  Eigen::MatrixXd Sigma() const { return H.inverse(); }
};

inline DenseSystem dense_system(const Graph& graph, const std::vector<bool>& held) {
  Linearizer linearizer(graph, held);
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(static_cast<std::size_t>(linearizer.structure().size()));
  DenseSystem result;
  if (g.empty()) return result;
  linearizer.linearize(graph.values(), H, g);
  result.H = dense(H);
  result.g = Eigen::Map<Eigen::VectorXd>(g.data(), std::ssize(g));
  for (int b = 0; b < linearizer.structure().blocks(); ++b) {
    result.rows[graph.id(linearizer.variable_of(b))] = {linearizer.structure().offsets()[b],
                                                        linearizer.structure().block_size(b)};
  }
  return result;
}

inline DenseSystem dense_system(const Graph& graph) {
  return dense_system(graph, resolve_gauge(graph).held);
}

/// Gauss-Newton with a dense solve, from the graph's states, until the step is nothing: the minimum
/// next to them. Returns the sum of the steps, which is small where they were at it before.
inline double solve_densely(Graph& graph, int iterations = 30) {
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  if (linearizer.structure().blocks() == 0) return 0.0;
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(static_cast<std::size_t>(linearizer.structure().size()));
  double moved = 0.0;
  for (int k = 0; k < iterations; ++k) {
    linearizer.linearize(graph.values(), H, g);
    const Eigen::Map<const Eigen::VectorXd> right(g.data(), std::ssize(g));
    const Eigen::VectorXd step = dense(H).ldlt().solve(right);
    Values values;
    linearizer.retract(graph.values(), {step.data(), static_cast<std::size_t>(step.size())},
                       values);
    graph.set_values(std::move(values));
    moved += step.norm();
    if (step.norm() < 1e-12) break;
  }
  return moved;
}

}  // namespace cairn::test
