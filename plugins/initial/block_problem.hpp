// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"

namespace cairn::initial {

/// A linear least-squares problem H X = G with one D × D block an unknown and `Columns` right-hand
/// sides, solved by a linear solver of the registry.
template <int D, int Columns>
class BlockProblem {
 public:
  using Matrix = Eigen::Matrix<double, D, D>;
  using Right = Eigen::Matrix<double, D, Columns>;

  /// `pairs`: the unknowns that meet in a term.
  BlockProblem(int unknowns, std::vector<std::pair<std::int32_t, std::int32_t>> pairs)
      : structure_(std::vector<std::int32_t>(static_cast<std::size_t>(unknowns), D),
                   std::move(pairs)),
        H_(structure_) {
    H_.set_zero();
    for (auto& column : G_) column.assign(static_cast<std::size_t>(structure_.size()), 0.0);
  }

  /// Adds B to the block (a, b) of H and, with a ≠ b, its transpose to (b, a).
  void add(int a, int b, const Matrix& B) {
    const std::int64_t entry = structure_.find(std::max(a, b), std::min(a, b));
    Eigen::Map<Matrix> block(H_.block(entry));
    if (a >= b) {
      block += B;
    } else {
      block += B.transpose();
    }
  }
  void add_right(int a, const Right& g) {
    for (int c = 0; c < Columns; ++c) segment(a, c) += g.col(c);
  }

  /// Replaces G by X. Where H is not positive definite, says at which unknown.
  Factorization solve(LinearSolver& solver) {
    solver.analyze(structure_);
    const Factorization result = solver.factorize(H_);
    if (!result.ok) return result;
    for (auto& column : G_) solver.solve(column, column);
    return result;
  }
  Right solution(int a) {
    Right x;
    for (int c = 0; c < Columns; ++c) x.col(c) = segment(a, c);
    return x;
  }

 private:
  Eigen::Map<Eigen::Matrix<double, D, 1>> segment(int a, int column) {
    return Eigen::Map<Eigen::Matrix<double, D, 1>>(G_[static_cast<std::size_t>(column)].data() +
                                                   static_cast<std::size_t>(a) * D);
  }

  BlockStructure structure_;
  BlockMatrix H_;
  std::array<std::vector<double>, Columns> G_;
};

}  // namespace cairn::initial
