// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/packed.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/graph/rounding.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

/// Whether pivots of Cholesky's method are more than what rounding left of zero, which the small
/// ones before them magnify. They are given as shares of their diagonal entries.
class SurePivots {
 public:
  bool operator()(double share) {
    constexpr double kRounding = 1e-14;
    const bool sure = share > kRounding / smallest_;
    smallest_ = std::min(smallest_, share);
    return sure;
  }

 private:
  double smallest_ = 1.0;
};

/// Cholesky's factor. False unless A is surely positive definite. `L` has the size of A.
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
  SurePivots is_sure;
  for (Eigen::Index row = 0; row < n; k += static_cast<std::size_t>(n - row++)) {
    const double pivot = llt.matrixLLT()(row, row);
    if (!is_sure(pivot * (pivot / A[k]))) return false;
  }
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
/// pivot is zero too, so that U gets a row of zeros there. False, too, where a pivot may be either.
bool cholesky_with_zeros(std::span<const double> A, int n, std::span<double> root) {
  Eigen::MatrixXd rest = unpack(A, n);
  if (!rest.allFinite()) return false;
  const Eigen::VectorXd scale = rest.diagonal().cwiseAbs().cwiseSqrt();
  Eigen::MatrixXd U = Eigen::MatrixXd::Zero(n, n);
  SurePivots is_sure;
  for (int k = 0; k < n; ++k) {
    if (rest(k, k) > kZeroPivot * scale(k) * scale(k)) {
      if (!is_sure(rest(k, k) / scale(k) / scale(k))) return false;
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

/// Eigenvalues of A, scaled to a unit diagonal: above minus the first, and below the second, one is
/// what rounding left of zero.
constexpr double kZeroEigenvalue = 1e-12, kNoEigenvalue = 1e-14;

/// B with BᵀB = A, as many rows as the rank of A; false if A is indefinite or not finite. Of the
/// eigenvectors of A scaled to a unit diagonal, so that units do not matter.
bool eigenvector_root(const Eigen::MatrixXd& A, Eigen::MatrixXd& B) {
  const Eigen::Index n = A.rows();
  const Eigen::VectorXd size = A.diagonal().cwiseAbs().cwiseSqrt();
  Eigen::VectorXd scale(n);
  for (Eigen::Index i = 0; i < n; ++i) scale(i) = size(i) > 0.0 ? 1.0 / size(i) : 0.0;
  if (!A.allFinite() || !scale.allFinite()) return false;
  for (Eigen::Index i = 0; i < n; ++i) {  // nothing beside a zero of the diagonal
    if (size(i) == 0.0 && (A.row(i).array() != 0.0).any()) return false;
  }
  const Eigen::MatrixXd scaled = scale.asDiagonal() * A * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  if (eigen.info() != Eigen::Success || !(values(0) >= -kZeroEigenvalue)) return false;
  const Eigen::Index rank = (values.array() > kNoEigenvalue).count();
  B = values.tail(rank).cwiseSqrt().asDiagonal() *
      eigen.eigenvectors().rightCols(rank).transpose() * size.asDiagonal();
  return true;
}

/// The root of a semidefinite matrix that has small eigenvalues beside those of zero, as one that
/// was printed: Cholesky's method divides by them, and takes what rounding leaves for indefinite.
/// Here B is brought to upper triangular form by reflections, where a column that adds nothing to
/// those before it gets a row of zeros.
bool reflected_root(std::span<const double> A, int n, std::span<double> root) {
  const Eigen::MatrixXd full = unpack(A, n);
  Eigen::MatrixXd B, U = Eigen::MatrixXd::Zero(n, n);
  if (!eigenvector_root(full, B)) return false;
  constexpr double kNothing = 1e-12;  // of a column's length, which eigenvectors are good to
  Eigen::Index row = 0;
  for (Eigen::Index k = 0; k < n && row < B.rows(); ++k) {
    Eigen::VectorXd v = B.col(k).tail(B.rows() - row);
    const double length = v.norm();
    if (!(length > kNothing * std::sqrt(full(k, k)))) continue;
    v(0) += v(0) < 0.0 ? -length : length;
    auto rest = B.bottomRightCorner(B.rows() - row, n - k);
    const Eigen::RowVectorXd along = v.transpose() * rest;
    rest -= (2.0 / v.squaredNorm()) * v * along;
    if (rest(0, 0) < 0.0) rest.row(0) *= -1.0;
    U.row(k).tail(n - k) = rest.row(0);
    ++row;
  }
  pack(U, root.data());
  return true;
}

/// Of the semidefinite matrix that may have been rounded to floats.
bool root_of_floats(std::span<const double> A, int n, std::span<double> U) {
  if (!are_floats(A)) return false;
  std::vector<double> settled(A.begin(), A.end()), rounding(A.size(), 0.0);
  add_float_rounding(n, A, rounding);
  return settle_rounding(n, rounding, settled) && square_root_of_doubles(settled, n, U);
}

}  // namespace

bool square_root_of_doubles(std::span<const double> A, int n, std::span<double> U) {
  if (n == 0) return true;
  return cholesky(A, n, U) || cholesky_with_zeros(A, n, U) || reflected_root(A, n, U);
}

bool square_root(std::span<const double> A, int n, std::span<double> U) {
  return square_root_of_doubles(A, n, U) || root_of_floats(A, n, U);
}

}  // namespace cairn
