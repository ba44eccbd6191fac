// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"

/// Symmetric n × n matrices as information is stored: the upper triangle row by row, n(n+1)/2
/// numbers a_00 a_01 … a_0,n−1 a_11 … a_n−1,n−1.
namespace cairn {

/// The number of doubles of a packed n × n matrix.
constexpr std::size_t packed_size(int n) {
  return static_cast<std::size_t>(n) * static_cast<std::size_t>(n + 1) / 2;
}

/// Packs the upper triangle of a square matrix; what is below the diagonal is not read.
/// `out`: packed_size(n) doubles.
template <class Matrix>
void pack(const Eigen::MatrixBase<Matrix>& A, double* out) {
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    for (Eigen::Index column = row; column < A.cols(); ++column) *out++ = A(row, column);
  }
}
template <class Matrix>
std::vector<double> pack(const Eigen::MatrixBase<Matrix>& A) {
  std::vector<double> out(packed_size(static_cast<int>(A.rows())));
  pack(A, out.data());
  return out;
}

/// The symmetric matrix that `packed` holds, into a square matrix that has its size.
template <class Matrix>
void unpack(const double* packed, Eigen::MatrixBase<Matrix>& A) {
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    for (Eigen::Index column = row; column < A.cols(); ++column)
      A(row, column) = A(column, row) = *packed++;
  }
}
/// The symmetric N × N matrix that `packed` holds.
template <int N>
Eigen::Matrix<double, N, N> unpack(const double* packed) {
  Eigen::Matrix<double, N, N> A;
  unpack(packed, A);
  return A;
}
/// The symmetric n × n matrix that `packed` holds; packed_size(n) doubles.
inline Eigen::MatrixXd unpack(std::span<const double> packed, int n) {
  Eigen::MatrixXd A(n, n);
  unpack(packed.data(), A);
  return A;
}

/// The square root U of a packed symmetric matrix A: upper triangular with UᵀU = A and no negative
/// entry on its diagonal, packed into `root` (packed_size(n) doubles, which may be those of A).
/// That is the Cholesky factor where A is positive definite; where it is semidefinite U has a row
/// of zeros for each direction that A lacks. False, with no meaning in `root`, if A is not finite,
/// or indefinite by more than the rounding of its diagonal: of floats where all numbers are floats.
CAIRN_API bool square_root(std::span<const double> A, int n, std::span<double> root);

}  // namespace cairn
