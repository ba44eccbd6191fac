// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "pcg/preconditioner.hpp"

namespace cairn {

/// M = the diagonal blocks of H: cheap, parallel, and it takes the units out of the problem. It
/// does nothing against the long chains of a trajectory, which is where the iterations go.
class BlockJacobi final : public Preconditioner {
 public:
  BlockJacobi() = default;
  /// Factorised already; `diagonal` must outlive this object.
  explicit BlockJacobi(const iterative::DiagonalBlocks& diagonal) : diagonal_(&diagonal) {}
  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal,
                          const NormalBlocks* factors) override;
  double apply(std::span<const double> r, std::span<double> z) override;
  std::string note() const override;

 private:
  const iterative::DiagonalBlocks* diagonal_ = nullptr;
};

}  // namespace cairn
