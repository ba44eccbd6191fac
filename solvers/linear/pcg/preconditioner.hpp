// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "iterative/diagonal_blocks.hpp"
#include "pcg/normal_blocks.hpp"

namespace cairn {

/// A symmetric positive definite M, close to H and easy to solve with: conjugate gradients converge
/// as the square root of the condition number of M⁻¹H has it.
class Preconditioner {
 public:
  Preconditioner() = default;
  Preconditioner(const Preconditioner&) = delete;
  Preconditioner& operator=(const Preconditioner&) = delete;
  virtual ~Preconditioner() = default;

  /// The structure must outlive this object.
  virtual void analyze(const BlockStructure& structure) = 0;
  /// `diagonal`: the diagonal blocks of H, factorised with success. `factors`: what H is made of,
  /// or null where that is not at hand.
  virtual Factorization factorize(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal,
                                  const NormalBlocks* factors) = 0;
  /// z = M⁻¹ r; returns rᵀ z. Vectors must not overlap.
  virtual double apply(std::span<const double> r, std::span<double> z) = 0;
  /// Whether it is the better for knowing the factors.
  virtual bool wants_factors() const { return false; }
  /// What a user should know of it.
  virtual std::string note() const = 0;
};

}  // namespace cairn
