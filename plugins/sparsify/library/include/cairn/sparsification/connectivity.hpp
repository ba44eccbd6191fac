// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// The smallest eigenvalue of a graph's Laplacian but the zero of the constant vector, and its unit
/// eigenvector.
struct FiedlerPair {
  double value = 0.0;
  std::vector<double> vector;
};

/// Computes the algebraic connectivity λ2 of one graph for many weights of its edges: of the
/// Laplacian L(w) = Σ w_k (e_a − e_b)(e_a − e_b)ᵀ (Fiedler 1973).
///
/// By Lanczos' method with full orthogonalisation on the inverse: with the first node grounded, L
/// is positive definite, and a solve with it, with the mean subtracted, is a product with the
/// pseudoinverse, whose largest eigenvalue is 1/λ2. It begins at the vector of the call before.
///
/// `value` is the Rayleigh quotient of `vector`, so never less than λ2, and vᵀL(w′)v ≥ λ2(w′) for
/// any other weights w′ as well: bounds from it hold whatever the accuracy.
class CAIRN_API FiedlerSolver {
 public:
  using Edge = std::array<int, 2>;

  /// `solver` must outlive this object and serve no other in between. Throws `Error` (input) if the
  /// edges do not connect all nodes, or there are less than two.
  FiedlerSolver(int nodes, std::vector<Edge> edges, LinearSolver& solver);
  /// Of the variables that these edges join, numbered in their order.
  FiedlerSolver(std::span<const RelativeEdge> edges, LinearSolver& solver);

  std::span<const Edge> edges() const { return edges_; }

  /// For these weights, one per edge, not negative. Throws `Error` (numerical) if the edges with
  /// weight do not connect all nodes, or the iteration does not converge.
  const FiedlerPair& solve(std::span<const double> weights);

 private:
  void factorize(std::span<const double> weights);
  void multiply_inverse(std::vector<double>& x);
  /// One run of Lanczos' method from v, which becomes the best vector found; whether it converged.
  bool improve(std::vector<double>& v);
  double quotient(std::span<const double> weights, std::span<const double> v) const;

  int nodes_;
  std::vector<Edge> edges_;
  LinearSolver* solver_;
  BlockStructure structure_;
  BlockMatrix L_;
  /// Where the diagonal entries of both ends and the one off the diagonal are in L; −1: grounded.
  std::vector<std::array<std::int64_t, 3>> entries_;
  FiedlerPair pair_;
};

}  // namespace cairn
