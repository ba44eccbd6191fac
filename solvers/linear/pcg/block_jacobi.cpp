// SPDX-License-Identifier: BSD-3-Clause
#include "pcg/block_jacobi.hpp"

namespace cairn {

void BlockJacobi::analyze(const BlockStructure&) {}

Factorization BlockJacobi::factorize(const BlockMatrix&, const iterative::DiagonalBlocks& diagonal,
                                     const NormalBlocks*) {
  diagonal_ = &diagonal;
  return {};
}

double BlockJacobi::apply(std::span<const double> r, std::span<double> z) {
  return diagonal_->solve(r, z);
}

std::string BlockJacobi::note() const { return "block Jacobi preconditioner"; }

}  // namespace cairn
