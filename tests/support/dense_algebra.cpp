// SPDX-License-Identifier: BSD-3-Clause
#include "support/dense_algebra.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace cairn::test {

Eigen::VectorXd dense_solution(const Eigen::MatrixXd& H, const Eigen::VectorXd& g) {
  return H.ldlt().solve(g);
}

Eigen::MatrixXd symmetric_inverse(const Eigen::MatrixXd& H) {
  return H.ldlt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()));
}

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& A) { return A.inverse(); }

double log_determinant_of(const Eigen::MatrixXd& H) {
  return H.ldlt().vectorD().array().log().sum();
}

Eigen::VectorXd eigenvalues_of(const Eigen::MatrixXd& H) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(H, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace cairn::test
