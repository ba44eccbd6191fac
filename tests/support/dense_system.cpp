// SPDX-License-Identifier: BSD-3-Clause
#include "support/dense_system.hpp"

#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "cairn/graph/gauge.hpp"
#include "cairn/linear/linearizer.hpp"
#include "support/block_systems.hpp"

namespace cairn::test {

Eigen::MatrixXd DenseSystem::Sigma() const { return H.inverse(); }

DenseSystem dense_system(const Graph& graph, const std::vector<bool>& held) {
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

DenseSystem dense_system(const Graph& graph) {
  return dense_system(graph, resolve_gauge(graph).held);
}

double solve_densely(Graph& graph, int iterations) {
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
