// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pcg/preconditioner.hpp"

namespace cairn {

/// M = the part of H that a subgraph makes, a spanning forest and some loop closures, factorised
/// exactly by another linear solver: the subgraph preconditioner (Dellaert, Carlson, Ila, Ni,
/// Thorpe 2010; Jian, Balcan, Dellaert 2011), the subgraph chosen on the block graph of H.
///
/// Where the factors are at hand, M = J₁ᵀJ₁ + D with J₁ the factors whose blocks all lie in the
/// subgraph. Then H = M + J₂ᵀJ₂ ⪰ M: the eigenvalues of M⁻¹H are at least 1, and all of them are 1
/// but as many as the factors left out have residuals.
///
/// Where there is H alone, or the factors kept do not determine every unknown, M has the blocks of
/// H in the subgraph and the whole diagonal of H. It is then positive definite where every factor
/// stands on one or two variables: H = Σ over factors of [A C; Cᵀ B] ⪰ 0, and dropping the C of
/// some factors leaves [A 0; 0 B] ⪰ 0 of them. Since [A C; Cᵀ B] ⪯ 2 [A 0; 0 B], also H ⪯ 2 M: the
/// largest eigenvalue of M⁻¹H is at most 2, and what is dropped shows at the small end. Where
/// factors stand on more variables, or H is a Schur complement, M may fail to be positive definite;
/// its diagonal blocks are then scaled by 1 + α, α = 1e-3, 1e-2, …
///
/// The subgraph is chosen by the values of the first factorisation after `analyze` and kept.
class Subgraph final : public Preconditioner {
 public:
  /// `solver`: factorises M. `extra`: loop closures taken besides the forest, as a fraction of the
  /// blocks.
  Subgraph(std::unique_ptr<LinearSolver> solver, double extra);

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal,
                          const NormalBlocks* factors) override;
  double apply(std::span<const double> r, std::span<double> z) override;
  bool wants_factors() const override { return true; }
  std::string note() const override;

  /// M as it was factorised last.
  const BlockMatrix& matrix() const { return M_; }

 private:
  void choose(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal);
  void copy(const BlockMatrix& H, double shift);
  bool factorize_kept(const NormalBlocks& factors);

  std::unique_ptr<LinearSolver> solver_;
  const double extra_;
  const BlockStructure* structure_ = nullptr;
  std::optional<BlockStructure> part_;  // the subgraph, once it is chosen
  std::vector<std::int64_t> source_;    // by entry of the part: the entry of H
  std::vector<std::uint8_t> marked_;    // by entry of H: an off-diagonal block that is kept
  BlockMatrix part_of_H_;               // of the factors kept, on the structure of H
  bool by_factors_ = false;             // M is J₁ᵀJ₁ + D
  BlockMatrix M_;
  std::int64_t kept_ = 0;  // off-diagonal blocks
  double largest_shift_ = 0.0;
};

}  // namespace cairn
