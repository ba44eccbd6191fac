// SPDX-License-Identifier: BSD-3-Clause
#include "pose_laplacian.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/LU>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

using Eigen::Matrix3d;

double edge_weight(const Matrix3d& covariance) { return 1.0 / std::cbrt(covariance.determinant()); }

PoseLaplacian::PoseLaplacian(const Graph& graph, std::span<const Id> poses, LinearSolver& solver)
    : solver_(&solver), block_of_(static_cast<std::size_t>(graph.variable_count()), -1) {
  const std::vector<bool> held = resolve_gauge(graph).held;
  int count = 0;
  for (std::size_t v = 0; v < block_of_.size(); ++v) {
    if (!held[v]) block_of_[v] = count++;
  }
  for (const Id id : poses)
    blocks_.push_back(block_of_[static_cast<std::size_t>(graph.find(id).value())]);
  columns_.resize(static_cast<std::size_t>(count));
  const std::vector<Edge> edges = edges_of(graph);
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (const Edge& edge : edges) {
    if (edge.blocks[0] >= 0 && edge.blocks[1] >= 0)
      pairs.emplace_back(edge.blocks[0], edge.blocks[1]);
  }
  structure_ = BlockStructure(std::vector<std::int32_t>(static_cast<std::size_t>(count), 1),
                              std::move(pairs));
  if (count == 0) return;
  solver_->analyze(structure_);
  if (!solver_->factorize(matrix(edges)).ok) {
    throw Error(ErrorCode::numerical,
                "the Laplacian of the pose graph is singular: its relative factors do not connect "
                "all poses");
  }
  log_determinant_ = query<LogDeterminant>(*solver_)->log_determinant();
}

std::vector<PoseLaplacian::Edge> PoseLaplacian::edges_of(const Graph& graph) {
  const LoopClosures factors = find_loop_closures(graph);
  std::vector<Edge> edges;
  const auto add = [&](int f) {
    const std::span<const std::int32_t> ends = graph.factor_variables(f);
    // Ω = UᵀU, the upper triangle of U row by row.
    const std::span<const double> U = graph.sqrt_information(f);
    if (U.size() != 6)
      throw Error(ErrorCode::usage, "the Laplacian of a pose graph is one of poses in the plane");
    edges.push_back({{block_of_[static_cast<std::size_t>(ends[0])],
                      block_of_[static_cast<std::size_t>(ends[1])]},
                     std::cbrt(std::pow(U[0] * U[3] * U[5], 2.0))});
  };
  std::ranges::for_each(factors.backbone, add);
  std::ranges::for_each(factors.candidates, add);
  return edges;
}

BlockMatrix PoseLaplacian::matrix(const std::vector<Edge>& edges) const {
  BlockMatrix L(structure_);
  L.set_zero();
  for (const auto& [blocks, weight] : edges) {
    for (const int block : blocks) {
      if (block >= 0) *L.block(structure_.find(block, block)) += weight;
    }
    if (blocks[0] < 0 || blocks[1] < 0) continue;
    const auto [low, high] = std::minmax(blocks[0], blocks[1]);
    *L.block(structure_.find(high, low)) -= weight;
  }
  return L;
}

double PoseLaplacian::inverse(int a, int b) {
  const int row = blocks_[static_cast<std::size_t>(a)], at = blocks_[static_cast<std::size_t>(b)];
  if (row < 0 || at < 0) return 0.0;
  std::vector<double>& column = columns_[static_cast<std::size_t>(at)];
  if (column.empty()) {
    column.assign(columns_.size(), 0.0);
    column[static_cast<std::size_t>(at)] = 1.0;
    solver_->solve(column, column);
  }
  return column[static_cast<std::size_t>(row)];
}

}  // namespace cairn
