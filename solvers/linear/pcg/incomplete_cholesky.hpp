// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "pcg/preconditioner.hpp"

namespace cairn {

/// M = L Lᵀ by incomplete block Cholesky without fill (Meijerink, van der Vorst 1977): L has a
/// block where H has one, in the order of the variables, and updates that would fall elsewhere are
/// dropped. For H that is not an M-matrix a pivot may then fail although H is positive definite; if
/// so H is factorised with its diagonal blocks scaled by 1 + α, α = 1e-3, 1e-2, … (Manteuffel
/// 1980), which ends, since a matrix with a heavy enough diagonal never breaks down. The triangular
/// solves run on one thread.
class IncompleteCholesky final : public Preconditioner {
 public:
  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal,
                          const NormalBlocks* factors) override;
  double apply(std::span<const double> r, std::span<double> z) override;
  std::string note() const override;

  /// α of the last factorisation.
  double shift() const { return shift_; }

 private:
  bool try_factorize(const BlockMatrix& H);
  bool factorize_column(int j);
  void update_columns(int j);
  void forward(double* z) const;   // z = L⁻¹ z
  void backward(double* z) const;  // z = L⁻ᵀ z

  const BlockStructure* structure_ = nullptr;
  std::vector<double> L_;            // on H's own structure
  std::vector<std::int64_t> place_;  // by block row: its entry in the column being updated, or -1
  double shift_ = 0.0;
  double largest_shift_ = 0.0;  // since analyze
};

}  // namespace cairn
