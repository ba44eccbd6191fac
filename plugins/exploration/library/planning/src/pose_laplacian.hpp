// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"

namespace cairn {

/// |Ω|^{1/3}, the weight of an edge between poses in the plane whose measurement has the covariance
/// Ω⁻¹.
double edge_weight(const Eigen::Matrix3d& covariance);

/// The Laplacian of a pose graph in the plane, L = Σ w (e_a − e_b)(e_a − e_b)ᵀ over its relative
/// factors, w = |Ω|^{1/3}, without the rows and columns of poses that are constant; factorised.
/// L⁻¹ is then to edges what the covariance is to relative poses: (e_a − e_b)ᵀ L⁻¹ (e_a − e_b) is
/// the effective resistance between two poses.
class PoseLaplacian {
 public:
  /// `poses` are numbered in their order. `solver` must outlive this object and serve no other.
  /// Throws `Error` as `PathOptimalities` does.
  PoseLaplacian(const Graph& graph, std::span<const Id> poses, LinearSolver& solver);

  double log_determinant() const { return log_determinant_; }
  int free() const { return static_cast<int>(structure_.size()); }  ///< poses that are not constant
  /// (a, b) of L⁻¹; zero for a constant pose. Column b is solved for when it is first asked for.
  double inverse(int a, int b);

 private:
  struct Edge {
    std::array<int, 2> blocks;  ///< −1: constant
    double weight;
  };
  std::vector<Edge> edges_of(const Graph& graph);
  BlockMatrix matrix(const std::vector<Edge>& edges) const;

  LinearSolver* solver_;
  std::vector<int> block_of_;  ///< by variable of the graph
  std::vector<int> blocks_;    ///< by number of a pose
  BlockStructure structure_;
  double log_determinant_ = 0.0;
  std::vector<std::vector<double>> columns_;  ///< by block, as far as they were asked for
};

}  // namespace cairn
