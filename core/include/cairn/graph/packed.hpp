// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Doubles of a symmetric n × n matrix that is stored as its upper triangle, row by row, as all
/// information matrices are.
constexpr std::size_t packed_size(int n) {
  return static_cast<std::size_t>(n) * static_cast<std::size_t>(n + 1) / 2;
}

/// The upper triangle of a square matrix, row by row.
CAIRN_API std::vector<double> pack(const Eigen::Ref<const Eigen::MatrixXd>& A);

/// The symmetric n × n matrix of an upper triangle.
CAIRN_API Eigen::MatrixXd unpack(std::span<const double> upper, int n);

/// U, packed into `root` (packed_size(n) doubles), with UᵀU = A for a symmetric positive
/// semidefinite A: the Cholesky factor where A is positive definite, otherwise one with a zero row
/// for each direction that A lacks. False if A is indefinite or not finite.
CAIRN_API bool square_root(std::span<const double> upper, int n, double* root);

}  // namespace cairn
