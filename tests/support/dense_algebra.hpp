// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace cairn::test {

// Dense decompositions, which sparse and incremental solvers are compared with. Here, since Eigen's
// templates for them would otherwise be compiled again for every test.

/// H⁻¹ g of a symmetric H, by LDLᵀ.
Eigen::VectorXd dense_solution(const Eigen::MatrixXd& H, const Eigen::VectorXd& g);
/// The same of the identity: the inverse of a symmetric H.
Eigen::MatrixXd symmetric_inverse(const Eigen::MatrixXd& H);
/// By LU with partial pivoting.
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& A);
/// Of a symmetric positive definite H, by LDLᵀ.
double log_determinant_of(const Eigen::MatrixXd& H);
/// Of a symmetric matrix, the smallest first.
Eigen::VectorXd eigenvalues_of(const Eigen::MatrixXd& H);

}  // namespace cairn::test
