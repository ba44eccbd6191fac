// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <SuiteSparseQR.hpp>

#include "cairn/linear/jacobian.hpp"

namespace cairn {

/// One sparse matrix J P, or [J; √D] P with the damping as rows of its own below, and its QR
/// factorisation by SuiteSparseQR. The pattern, the map of the blocks' values into it, and
/// SuiteSparseQR's symbolic analysis are made once, in the constructor.
class SpqrFactor {
 public:
  /// `order`: block columns in the order of elimination. `common` must outlive this object.
  SpqrFactor(const JacobianStructure& structure, std::span<const std::int32_t> order, bool damped,
             cholmod_common& common);
  ~SpqrFactor();
  SpqrFactor(const SpqrFactor&) = delete;
  SpqrFactor& operator=(const SpqrFactor&) = delete;

  /// Factorises. The result is the first column (in the order of elimination) that depends on those
  /// before it, or -1.
  std::int64_t factorize(const JacobianMatrix& J, std::span<const double> damping);
  /// x = argmin ‖[J; √D] x + [r; 0]‖, in the columns' order of elimination.
  void minimize(std::span<const double> residual, std::span<double> x);
  /// x = (AᵀA)⁻¹ g for the matrix A that was factorised, by RᵀR x = g (the semi-normal equations);
  /// both in the columns' order of elimination. x may be g.
  void solve_normal(std::span<const double> g, std::span<double> x);
  /// |R_kk| of the last factorisation, by column.
  std::span<const double> diagonal() const { return diagonal_; }

  /// Scalars of R as analysed, and multiplications and additions of the last factorisation.
  std::int64_t factor_nonzeros() const { return factor_nonzeros_; }
  double factor_flops() const { return factor_flops_; }

 private:
  cholmod_sparse matrix();
  void copy_solution(cholmod_dense* solution, std::span<double> x);
  void build_pattern(const JacobianStructure& structure, std::span<const std::int32_t> order,
                     bool damped);
  void read_diagonal();

  cholmod_common& common_;
  std::size_t rows_ = 0;
  std::vector<SuiteSparse_long> column_begin_;
  std::vector<SuiteSparse_long> row_of_;
  std::vector<std::int64_t> source_;  // in J's values; ~k for √damping[k]
  std::vector<double> values_;
  std::vector<double> right_;
  std::vector<double> diagonal_;
  SuiteSparseQR_factorization<double>* qr_ = nullptr;
  std::int64_t factor_nonzeros_ = 0;
  double factor_flops_ = 0.0;
};

}  // namespace cairn
