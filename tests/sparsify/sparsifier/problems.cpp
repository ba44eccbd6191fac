// SPDX-License-Identifier: BSD-3-Clause
#include "sparsify/sparsifier/problems.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace cairn::sparsify {

Matrix Draw::matrix(int rows, int columns) {
  Matrix A(rows, columns);
  for (double& number : A.reshaped()) number = normal_(engine_);
  return A;
}

Matrix Draw::definite(int n) {
  const Matrix A = matrix(n, n);
  return A * A.transpose() / n + Matrix::Identity(n, n);
}

Eigen::Map<const Matrix> jacobian(const RecoveryProblem::Factor& factor, int rank) {
  return {factor.jacobian.data(), factor.size, rank};
}

Eigen::Map<const Matrix> information(const RecoveryResult& result, int k, int size) {
  return {result.information[k].data(), size, size};
}

void add_factor(RecoveryProblem& problem, const Matrix& J) {
  problem.factors.push_back({.size = static_cast<int>(J.rows()),
                             .jacobian = {J.data(), J.data() + J.size()},
                             .off_diagonal = {}});
}

RecoveryProblem full_problem(Draw& draw, int m, int rank, int factors) {
  RecoveryProblem problem{.rank = rank, .factors = {}};
  for (int k = 0; k < factors; ++k) add_factor(problem, draw.matrix(m, rank));
  return problem;
}

RecoveryProblem pairwise_problem(Draw& draw, int m, int nodes, int more, bool plain) {
  RecoveryProblem problem{.rank = m * (nodes - 1), .factors = {}};
  const int r = problem.rank;
  const Matrix mix = plain
                         ? Matrix::Identity(r, r)
                         : Matrix(Matrix::Identity(r, r) + 0.3 / std::sqrt(r) * draw.matrix(r, r));
  const auto relate = [&](int i, int j) {
    Matrix J = Matrix::Zero(m, r);
    // Relative poses seen from near by: about −I and I.
    if (i > 0) J.middleCols(m * (i - 1), m) = -Matrix::Identity(m, m) - 0.2 * draw.matrix(m, m);
    if (j > 0) J.middleCols(m * (j - 1), m) = Matrix::Identity(m, m) + 0.2 * draw.matrix(m, m);
    add_factor(problem, J * mix);
  };
  std::vector<std::pair<int, int>> open;
  std::vector<int> up(nodes, -1);
  for (int j = 1; j < nodes; ++j) relate(up[j] = draw.integer(j), j);
  for (int i = 0; i < nodes; ++i) {
    for (int j = i + 1; j < nodes; ++j) {
      if (up[j] != i) open.emplace_back(i, j);
    }
  }
  for (int k = 0; k < more && !open.empty(); ++k) {
    const auto chosen = open.begin() + draw.integer(static_cast<int>(open.size()));
    relate(chosen->first, chosen->second);
    open.erase(chosen);
  }
  return problem;
}

std::vector<Matrix> random_weights(Draw& draw, const ScaledProblem& problem, double size) {
  std::vector<Matrix> W;
  for (int k = 0; k < problem.factors(); ++k)
    W.push_back(size * draw.uniform(0.3, 1.0) * draw.definite(problem.size(k)));
  return W;
}

Matrix approximated(const RecoveryProblem& problem, const std::vector<Matrix>& Omega, int without) {
  Matrix L = Matrix::Zero(problem.rank, problem.rank);
  for (int k = 0; k < static_cast<int>(Omega.size()); ++k) {
    const auto J = jacobian(problem.factors[k], problem.rank);
    if (k != without) L += J.transpose() * Omega[k] * J;
  }
  return L;
}

double log_determinant_of(const Matrix& A) {
  return 2.0 * A.llt().matrixLLT().diagonal().array().log().sum();
}

double dense_kld(const Matrix& L) {
  return 0.5 * (L.trace() - log_determinant_of(L) - static_cast<double>(L.rows()));
}

double dense_kld(const RecoveryProblem& problem, const std::vector<Matrix>& Omega) {
  return dense_kld(approximated(problem, Omega));
}

std::vector<Matrix> informations(const RecoveryProblem& problem, const RecoveryResult& result) {
  std::vector<Matrix> all;
  for (int k = 0; k < static_cast<int>(problem.factors.size()); ++k)
    all.emplace_back(information(result, k, problem.factors[k].size));
  return all;
}

double least_eigenvalue(const Matrix& A) {
  return Eigen::SelfAdjointEigenSolver<Matrix>(0.5 * (A + A.transpose())).eigenvalues()[0];
}

double apart(const Matrix& A, const Matrix& B) {
  return (A - B).cwiseAbs().maxCoeff() / std::max(1.0, B.cwiseAbs().maxCoeff());
}

}  // namespace cairn::sparsify
