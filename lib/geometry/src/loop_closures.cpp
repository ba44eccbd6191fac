// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/loop_closures.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>

#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linearizer.hpp"
#include "dense/cholesky.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;

/// By variable its rank among the ids of its type.
std::vector<int> ranks(const Graph& graph) {
  std::vector<int> rank(graph.variable_count());
  for (const VariablePool& pool : graph.variable_pools()) {
    std::vector<std::int32_t> order(pool.variables.begin(), pool.variables.end());
    std::ranges::sort(order, {}, [&](int v) { return graph.id(v); });
    for (std::size_t k = 0; k < order.size(); ++k) rank[order[k]] = static_cast<int>(k);
  }
  return rank;
}

bool joins_rigidly(const Graph& graph, int factor) {
  const FactorType& type = graph.factor_type(factor);
  return type.arity() == 2 && type.is_relative() &&
         graph.type(graph.factor_variables(factor)[0]).lie_group() &&
         graph.information_rank(factor) == type.residual_size() &&
         type.residual_size() == type.tangent_size(0);
}

/// ln |Ω| of a factor whose information has full rank.
double log_information(const Graph& graph, int factor) {
  const std::span<const double> U = graph.sqrt_information(factor);
  const int n = graph.factor_type(factor).residual_size();
  double sum = 0.0;
  for (int row = 0, at = 0; row < n; at += n - row, ++row) sum += 2.0 * std::log(std::abs(U[at]));
  return sum;
}

/// n / tr(Ω_part⁻¹) of a part of the coordinates; 0 where the others leave nothing of it.
double isotropic(const MatrixXd& information, Eigen::Index first, Eigen::Index size) {
  if (size == 0) return 0.0;
  const MatrixXd part = information.block(first, first, size, size);
  const Eigen::LLT<MatrixXd> factor(part);
  if (factor.info() != Eigen::Success) return 0.0;
  const MatrixXd covariance = factor.solve(MatrixXd::Identity(size, size));
  return static_cast<double>(size) / covariance.trace();
}

}  // namespace

LoopClosures find_loop_closures(const Graph& graph) {
  struct Edge {
    int factor;
    bool odometry;
    double log_information;
  };
  const std::vector<int> rank = ranks(graph);
  std::vector<Edge> edges;
  std::vector<bool> joined(graph.variable_count());
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (!joins_rigidly(graph, f)) continue;
    const int a = graph.factor_variables(f)[0], b = graph.factor_variables(f)[1];
    edges.push_back({f, std::abs(rank[a] - rank[b]) == 1, log_information(graph, f)});
    joined[a] = joined[b] = true;
  }
  std::ranges::stable_sort(edges, [](const Edge& a, const Edge& b) {
    if (a.odometry != b.odometry) return a.odometry;
    return a.log_information > b.log_information;
  });
  LoopClosures found;
  DisjointSets sets(graph.variable_count());
  for (const Edge& edge : edges) {
    const int a = graph.factor_variables(edge.factor)[0],
              b = graph.factor_variables(edge.factor)[1];
    if (sets.join(a, b)) {
      found.backbone.push_back(edge.factor);
      found.odometry += edge.odometry;
    } else if (!graph.fixed(a) || !graph.fixed(b)) {
      found.candidates.push_back(edge.factor);
    }
  }
  std::ranges::sort(found.backbone);
  std::ranges::sort(found.candidates);
  found.components =
      static_cast<int>(std::ranges::count(joined, true) - std::ssize(found.backbone));
  return found;
}

std::vector<RelativeEdge> relative_edges(const Graph& graph, std::span<const int> factors) {
  // With all variables free: a factor on a constant one is an edge like any other.
  const Linearizer linearizer(graph, std::vector<bool>(graph.variable_count()));
  const JacobianEvaluator evaluator(graph, linearizer);
  JacobianMatrix J(evaluator.structure());
  evaluator.evaluate(graph.values(), J);
  const JacobianStructure& structure = J.structure();
  std::vector<RelativeEdge> edges;
  edges.reserve(factors.size());
  for (const int f : factors) {
    const std::span<const std::int32_t> ends = graph.factor_variables(f);
    const VariableType& type = graph.type(ends[1]);
    const Eigen::Index n = type.tangent_size();
    const Eigen::Index position =
        has_position(type) ? std::min<Eigen::Index>(n, type.placement()->dimension()) : 0;
    MatrixXd information = MatrixXd::Zero(n, n);
    for (auto k = structure.row_begin()[f]; k < structure.row_begin()[f + 1]; ++k) {
      if (linearizer.variable_of(structure.columns()[k]) != ends[1]) continue;
      const Eigen::Map<const MatrixXd> block(J.block(k), structure.row_sizes()[f], n);
      information = dense::product_of_transpose(block, block);
    }
    edges.push_back({{ends[0], ends[1]},
                     isotropic(information, position, n - position),
                     isotropic(information, 0, position)});
  }
  return edges;
}

}  // namespace cairn
