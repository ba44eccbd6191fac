// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/packed.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace cairn {
namespace {

/// Cholesky's factor. False unless A is positive definite. `L` has the size of A.
template <class Matrix>
bool cholesky(std::span<const double> A, Matrix L, std::span<double> U) {
  std::size_t k = 0;
  const Eigen::Index n = L.rows();
  for (Eigen::Index row = 0; row < n; ++row) {
    for (Eigen::Index column = row; column < n; ++column) L(column, row) = A[k++];
  }
  const Eigen::LLT<Matrix, Eigen::Lower> llt(L);
  if (llt.info() != Eigen::Success || !std::isfinite(llt.matrixLLT()(n - 1, n - 1))) return false;
  k = 0;
  for (Eigen::Index row = 0; row < n; ++row) {
    for (Eigen::Index column = row; column < n; ++column) U[k++] = llt.matrixLLT()(column, row);
  }
  return true;
}

bool cholesky(std::span<const double> A, int n, std::span<double> U) {
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 16, 16>;
  if (n == 3) return cholesky(A, Eigen::Matrix3d::Zero().eval(), U);
  if (n == 6) return cholesky(A, Eigen::Matrix<double, 6, 6>::Zero().eval(), U);
  if (n <= 16) return cholesky(A, Small(n, n), U);
  return cholesky(A, Eigen::MatrixXd(n, n), U);
}

/// A = D C D with D the root of A's diagonal, so that nothing depends on units. C = V Λ Vᵀ, and U
/// is the triangular factor of √Λ Vᵀ D: UᵀU = D V Λ Vᵀ D.
bool semidefinite_root(std::span<const double> A, int n, std::span<double> U) {
  Eigen::MatrixXd C = unpack(A, n);
  if (!C.allFinite() || (C.diagonal().array() < 0.0).any()) return false;
  const Eigen::VectorXd scale = C.diagonal().cwiseSqrt();
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column < n; ++column) {
      const double product = scale[row] * scale[column];
      if (product > 0.0) {
        C(row, column) /= product;
      } else if (C(row, column) != 0.0) {
        return false;  // [0 a; a b] has a negative eigenvalue
      }
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(C);
  constexpr double kRounding = 1e-12;
  if (eigen.info() != Eigen::Success || eigen.eigenvalues().minCoeff() < -kRounding * n)
    return false;
  const Eigen::MatrixXd root = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
                               eigen.eigenvectors().transpose() * scale.asDiagonal();
  Eigen::MatrixXd R =
      Eigen::HouseholderQR<Eigen::MatrixXd>(root).matrixQR().triangularView<Eigen::Upper>();
  for (int row = 0; row < n; ++row) {
    if (R(row, row) < 0.0) R.row(row) = -R.row(row);
  }
  pack(R, U.data());
  return true;
}

}  // namespace

bool square_root(std::span<const double> A, int n, std::span<double> U) {
  if (n == 0) return true;
  return cholesky(A, n, U) || semidefinite_root(A, n, U);
}

}  // namespace cairn
