// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/packed.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace cairn {
namespace {

/// A pivot below this share of its diagonal entry is what rounding left of zero, and what may be
/// left of a matrix that is positive semidefinite is no larger.
constexpr double kZeroPivot = 1e-12;

bool cholesky(std::span<const double> upper, int n, double* root) {
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 16, 16>;
  const auto factor = [&](auto A) {
    std::size_t k = 0;
    for (int row = 0; row < n; ++row) {
      for (int column = row; column < n; ++column) A(column, row) = upper[k++];
    }
    const Eigen::LLT<decltype(A), Eigen::Lower> llt(A);
    if (llt.info() != Eigen::Success) return false;
    k = 0;
    for (int row = 0; row < n; ++row) {
      for (int column = row; column < n; ++column) root[k++] = llt.matrixLLT()(column, row);
    }
    return std::isfinite(root[k - 1]);
  };
  if (n == 3) return factor(Eigen::Matrix3d::Zero().eval());
  if (n == 6) return factor(Eigen::Matrix<double, 6, 6>::Zero().eval());
  if (n <= 16) return factor(Small(n, n));
  return factor(Eigen::MatrixXd(n, n));
}

/// Cholesky's method where pivots may be zero: in a positive semidefinite matrix the row of a zero
/// pivot is zero too, so that U gets a row of zeros there.
bool semidefinite_cholesky(std::span<const double> upper, int n, double* root) {
  Eigen::MatrixXd A = unpack(upper, n);
  const Eigen::VectorXd scale = A.diagonal().cwiseAbs().cwiseSqrt();
  Eigen::MatrixXd U = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < n; ++k) {
    if (A(k, k) > kZeroPivot * scale(k) * scale(k)) {
      U.row(k).tail(n - k) = A.row(k).tail(n - k) / std::sqrt(A(k, k));
      A.bottomRightCorner(n - k, n - k) -= U.row(k).tail(n - k).transpose() * U.row(k).tail(n - k);
      continue;
    }
    for (int i = k; i < n; ++i) {
      if (!(std::abs(A(k, i)) <= kZeroPivot * scale(k) * scale(i))) return false;
    }
  }
  const std::vector<double> packed = pack(U);
  std::ranges::copy(packed, root);
  return true;
}

}  // namespace

std::vector<double> pack(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  std::vector<double> upper;
  upper.reserve(packed_size(static_cast<int>(A.rows())));
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    for (Eigen::Index column = row; column < A.cols(); ++column) upper.push_back(A(row, column));
  }
  return upper;
}

Eigen::MatrixXd unpack(std::span<const double> upper, int n) {
  Eigen::MatrixXd A(n, n);
  std::size_t k = 0;
  for (int row = 0; row < n; ++row) {
    for (int column = row; column < n; ++column) A(row, column) = A(column, row) = upper[k++];
  }
  return A;
}

bool square_root(std::span<const double> upper, int n, double* root) {
  if (!std::ranges::all_of(upper, [](double x) { return std::isfinite(x); })) return false;
  if (cholesky(upper, n, root)) return true;
  return semidefinite_cholesky(upper, n, root);
}

}  // namespace cairn
