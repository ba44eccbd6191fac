// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/jacobian.hpp"

namespace cairn {

/// H = JᵀJ + D by blocks, or the part of it that comes of some of the factors. All index work is
/// done once per structure; sums are taken in the order of the factors.
class NormalBlocks {
 public:
  void analyze(const JacobianStructure& structure);
  /// Of H: a block wherever two unknowns share a factor.
  const BlockStructure& structure() const { return structure_; }

  /// What to assemble from; J must outlive its use here, the damping is copied.
  void load(const JacobianMatrix& J, std::span<const double> damping);
  const JacobianMatrix& J() const { return *J_; }

  /// H of all factors.
  void assemble(BlockMatrix& H) const;
  /// H of those factors alone all of whose off-diagonal blocks are marked (by entry of
  /// `structure()`), and D.
  void assemble_part(std::span<const std::uint8_t> marked, BlockMatrix& H) const;

 private:
  /// J_aᵀ J_b of two entries of a row, a's unknown not before b's.
  struct Product {
    std::int64_t a, b;    // entries of J
    std::int64_t target;  // entry of H
  };
  template <class Keep>
  void assemble_if(Keep keep, BlockMatrix& H) const;

  const JacobianStructure* rows_ = nullptr;
  BlockStructure structure_;
  std::vector<Product> products_;            // row by row
  std::vector<std::int64_t> product_begin_;  // by block row
  const JacobianMatrix* J_ = nullptr;
  std::vector<double> damping_;
};

}  // namespace cairn
