// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "block/supernodal_cholesky.hpp"
#include "cairn/runtime/aligned.hpp"

namespace cairn::block {

/// The blocks of Z = H⁻¹ where L has blocks, by the recursion of Takahashi, Fagan and Chen (1973;
/// by blocks: Ila, Polok, Solony, Svoboda 2017, eq. 11) over the supernodes of a factorisation.
///
/// A supernode has columns J and rows R below them. With Y = L_RJ L_JJ⁻¹,
///
///     Z_RJ = -Z_RR Y,    Z_JJ = L_JJ⁻ᵀ L_JJ⁻¹ - Yᵀ Z_RJ,
///
/// and Z_RR is known, since R lies within the front of the parent. So the tree is processed from
/// its roots to its leaves: the factorisation in reverse, each supernode passing Z_RR to its
/// children where the factorisation had read their update matrices. It uses the factorisation's own
/// memory, which is free by then (with several threads it is made larger); what it allocates are
/// the panels of Z (as large as those of L) and a little memory for each thread, both once per
/// analysis. It takes about three times the arithmetic of a factorisation. Subtrees run in
/// parallel, and so do rows of large fronts; every number has one writer and one order of
/// summation, so the result does not depend on the number of threads.
class SelectedInverse {
 public:
  /// `cholesky` must outlive this object.
  explicit SelectedInverse(SupernodalCholesky& cholesky) : cholesky_(&cholesky) {}

  /// Computes Z from the last factorisation. Throws `std::logic_error` if there is none.
  void compute();
  /// Every diagonal block of the last `compute`, in the order of the structure's blocks: column-
  /// major, one after the other.
  void diagonal_blocks(std::span<double> out) const;
  /// Z_ij, size_i × size_j, column-major, if L has that block in the order of elimination; else
  /// leaves `out` alone and returns false.
  bool block(std::int32_t i, std::int32_t j, double* out) const;

 private:
  void prepare();
  void invert(std::int32_t s, std::int64_t lane);
  void invert_large(std::int32_t s);
  void hand_down(std::int32_t s, std::int32_t child, std::int64_t lane, int first, int last);
  void mirror(std::int32_t child, std::int64_t lane, int first, int last);
  double* panel(std::int32_t s) { return panels_.data() + nodes()[s].panel; }
  /// Z_RR of a supernode.
  double* rest(std::int32_t s, std::int64_t lane) {
    return cholesky_->double_.workspace.data() + placement_.of(s, lane);
  }
  std::span<const Supernode> nodes() const { return cholesky_->symbolic_.supernodes(); }

  SupernodalCholesky* cholesky_;
  std::uint64_t analysis_ = 0;              // that room was made for
  Placement placement_;                     // of Z_RR
  UninitializedVector panels_;              // of Z, laid out as those of L
  UninitializedVector room_;                // for V and T of a supernode, by lane
  std::int64_t lane_room_ = 0;              // doubles
  std::vector<std::int32_t> supernode_of_;  // by position
};

}  // namespace cairn::block
