// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/packed.hpp"

#include <algorithm>
#include <cmath>

#include "dense/cholesky.hpp"

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

/// A pivot below this share of its diagonal entry is what rounding left of zero, and what may be
/// left of a matrix that is positive semidefinite is no larger.
constexpr double kZeroPivot = 1e-12;

/// Cholesky's method where pivots may be zero: in a positive semidefinite matrix the row of a zero
/// pivot is zero too, so that U gets a row of zeros there.
bool semidefinite_root(std::span<const double> A, int n, std::span<double> root) {
  Eigen::MatrixXd rest = unpack(A, n);
  if (!rest.allFinite()) return false;
  const Eigen::VectorXd scale = rest.diagonal().cwiseAbs().cwiseSqrt();
  Eigen::MatrixXd U = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < n; ++k) {
    if (rest(k, k) > kZeroPivot * scale(k) * scale(k)) {
      U.row(k).tail(n - k) = rest.row(k).tail(n - k) / std::sqrt(rest(k, k));
      rest.bottomRightCorner(n - k, n - k) -=
          U.row(k).tail(n - k).transpose() * U.row(k).tail(n - k);
      continue;
    }
    for (int i = k; i < n; ++i) {
      if (!(std::abs(rest(k, i)) <= kZeroPivot * scale(k) * scale(i))) return false;
    }
  }
  pack(U, root.data());
  return true;
}

}  // namespace

bool square_root(std::span<const double> A, int n, std::span<double> U) {
  if (n == 0) return true;
  return cholesky(A, n, U) || semidefinite_root(A, n, U);
}

}  // namespace cairn
