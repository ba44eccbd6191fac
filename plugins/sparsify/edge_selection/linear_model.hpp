// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/sparsification/edge_selection.hpp"

namespace cairn::edges {

/// Rows J_k of a candidate by the blocks of the two variables that it joins, whitened; a constant
/// variable has the block −1, and its J no columns.
struct CandidateRows {
  std::array<int, 2> blocks{-1, -1};
  std::array<Eigen::MatrixXd, 2> J;
};

/// Λ(w) = H + Σ_k w_k J_kᵀ J_k: the information of a graph whose candidates have the weights w, H
/// being that of the factors that stay in any case. Positive definite for all w ≥ 0.
struct LinearModel {
  std::unique_ptr<BlockStructure> structure;  ///< with the blocks of all candidates
  BlockMatrix H;
  std::vector<CandidateRows> candidates;

  /// Λ(w).
  BlockMatrix information(std::span<const double> weights) const;
  /// Adds weight · J_kᵀJ_k to a matrix on this structure.
  void add(int k, double weight, BlockMatrix& to) const;
};

/// That of the graph, linearised at its states with the weights of its losses; H has the factors
/// that are not among `candidates` (positions, rising).
LinearModel linear_model(const Graph& graph, std::span<const int> candidates);

/// The relative factors of a graph that are no candidates, and behind them the candidates.
struct PoseGraphEdges {
  PoseGraphEdges(const Graph& graph, std::span<const int> candidates);
  /// Throws `Error` (input) if no candidate has such a weight.
  void check(EdgeWeight weight) const;

  std::vector<RelativeEdge> all;
  std::size_t stay = 0;  ///< how many are no candidates
};

/// The Laplacian of the relative factors by one weight, grounded at the variables that are
/// constant, and at one of each component without: J_k = √w_k (e_a − e_b)ᵀ, in blocks of one
/// number. All other factors are left out. Throws `Error` as `PoseGraphEdges::check` does.
LinearModel laplacian_model(const Graph& graph, std::span<const int> candidates, EdgeWeight weight);

/// Factorises a matrix on the structure of a model, which `solver` has analysed, and returns its
/// ln |Λ|. Throws `Error` (numerical) where it is singular.
double log_determinant(const BlockMatrix& information, LinearSolver& solver);
/// J_k Λ⁻¹ J_kᵀ of all candidates, Λ being what `solver` has factorised last.
std::vector<Eigen::MatrixXd> candidate_covariances(const LinearModel& model, LinearSolver& solver);

/// Throws `Error` (usage), with those that would do, if a linear solver lacks an ability that
/// these two need.
void check_solver(LinearSolver& solver);

}  // namespace cairn::edges
