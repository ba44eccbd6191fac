// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <random>
#include <vector>

#include <Eigen/Core>

#include "approximation.hpp"
#include "cairn/sparsification/sparsification.hpp"

namespace cairn::sparsify {

/// Random numbers and matrices.
class Draw {
 public:
  explicit Draw(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  int integer(int below) { return static_cast<int>(engine_() % static_cast<unsigned>(below)); }
  Matrix matrix(int rows, int columns);
  /// Full, with eigenvalues of 1 and more.
  Matrix definite(int n);

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> normal_;
};

Eigen::Map<const Matrix> jacobian(const RecoveryProblem::Factor& factor, int rank);
Eigen::Map<const Matrix> information(const RecoveryResult& result, int k, int size);
void add_factor(RecoveryProblem& problem, const Matrix& J);

/// Jacobians that know all coordinates.
RecoveryProblem full_problem(Draw& draw, int m, int rank, int factors);

/// Between nodes of m coordinates, the first of which is held: a tree, and `more` other pairs; in
/// coordinates that mix the nodes' unless `plain`. Factor k < nodes − 1 is an edge of the tree.
RecoveryProblem pairwise_problem(Draw& draw, int m, int nodes, int more, bool plain = false);

/// W of eigenvalues of about `size`.
std::vector<Matrix> random_weights(Draw& draw, const ScaledProblem& problem, double size = 1.0);

// Oracles, dense and by the definitions -----------------------------------------------------------

/// Σ_k J_kᵀ Ω_k J_k, without one factor if `without` ≥ 0.
Matrix approximated(const RecoveryProblem& problem, const std::vector<Matrix>& Omega,
                    int without = -1);

double log_determinant_of(const Matrix& A);

double dense_kld(const Matrix& L);
double dense_kld(const RecoveryProblem& problem, const std::vector<Matrix>& Omega);

std::vector<Matrix> informations(const RecoveryProblem& problem, const RecoveryResult& result);

double least_eigenvalue(const Matrix& A);

/// max |A − B|, as a part of the largest element if that is above 1.
double apart(const Matrix& A, const Matrix& B);

}  // namespace cairn::sparsify
