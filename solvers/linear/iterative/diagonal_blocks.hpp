// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"

namespace cairn::iterative {

/// Cholesky factorisation A = L Lᵀ of a small dense block in place, column-major n × n; only the
/// lower triangle is read and written. The diagonal of the result holds 1/L_kk, so that solving
/// divides nothing. False at a pivot that is not positive and finite.
bool factorize_block(double* A, int n);
/// x = L⁻¹ x.
void forward_block(const double* L, int n, double* x);
/// x = L⁻ᵀ x.
void backward_block(const double* L, int n, double* x);

/// The Cholesky factors of the diagonal blocks of H. That all of them are positive definite is
/// necessary for H to be, and the only part of it that an iterative solver can check beforehand.
class DiagonalBlocks {
 public:
  void analyze(const BlockStructure& structure);
  /// Fails at the first block that is not positive definite, or in whose column of H a value is not
  /// finite.
  Factorization factorize(const BlockMatrix& H);

  /// L of a block, as `factorize_block` leaves it.
  const double* block(int i) const { return values_.data() + begin_[i]; }
  /// H_ii⁻¹, whole, column-major.
  const double* inverse(int i) const { return inverses_.data() + begin_[i]; }
  /// z = D⁻¹ r, in parallel; returns rᵀ z.
  double solve(std::span<const double> r, std::span<double> z) const;

 private:
  const BlockStructure* structure_ = nullptr;
  std::vector<std::int64_t> begin_;
  std::vector<double> values_;
  std::vector<double> inverses_;  // one product instead of two substitutions with their divisions
  mutable std::vector<double> partial_;
};

}  // namespace cairn::iterative
