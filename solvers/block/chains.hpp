// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "block/kernels.hpp"
#include "cairn/linear/block_matrix.hpp"

namespace cairn::block {

/// The chains of a block graph, and what is left of it without them.
///
/// A chain is a path of blocks of one size that have no other neighbours than the next and the
/// previous one: poses between two loop closures. Its ends are *separators*, or there is nothing
/// beyond it. Eliminating a chain from one end to the other joins its separators; so what is left
/// is the graph of the separators with one more edge for each chain.
///
/// Chains of equal length stand side by side in *groups*, one in each lane of a vector, and all
/// lanes are eliminated at once (`ChainKernels`). Lengths are those of a short list; blocks that
/// are too many for a chain of such a length become separators.
class Chains {
 public:
  struct Chain {
    std::int32_t group, lane;
    std::int32_t first, last;  ///< its separators, as blocks of `rest`, or -1
    /// Where their blocks are in the values of `rest`: those of each, and the common one, which has
    /// the rows of the first if it is `turned`.
    std::int64_t first_block, last_block, common_block;
    bool turned;
    std::span<const std::int32_t> nodes(const Chains& all) const {
      return std::span(all.nodes_).subspan(begin, length);
    }
    std::size_t begin, length;  ///< in the list of all nodes
  };

  Chains() = default;
  /// Finds the chains; `lanes` of a group. None if too few blocks lie on chains to be worth it.
  Chains(const BlockStructure& structure, int lanes);

  bool empty() const { return chains_.empty(); }
  int block_size() const { return size_; }
  int lanes() const { return lanes_; }
  std::span<const Chain> chains() const { return chains_; }
  int groups() const { return static_cast<int>(group_length_.size()); }
  ChainGroup group(int g) const;
  /// Nodes in the lanes of all groups before g: where its numbers start.
  std::int64_t group_begin(int g) const { return group_begin_[g]; }
  /// The blocks that are on chains, chain by chain.
  std::span<const std::int32_t> nodes() const { return nodes_; }

  /// What is left: the separators, in their order.
  const BlockStructure& rest() const { return rest_; }
  std::span<const std::int32_t> separators() const { return separators_; }
  /// Where a block of the structure is in `rest`, or -1.
  std::span<const std::int32_t> place_in_rest() const { return in_rest_; }

  /// Stretches of the values between separators: where they are in H and in `rest`, there in
  /// rising order. What lies between two of them are blocks that chains alone contribute to.
  struct Copy {
    std::int64_t source, target, size;
  };
  std::span<const Copy> copies() const { return copies_; }

 private:
  void group_equal_lengths();
  void build_rest(const BlockStructure& structure);
  void place_numbers(const BlockStructure& structure);

  int size_ = 0, lanes_ = 0;
  std::vector<Chain> chains_;
  std::vector<std::int32_t> nodes_;
  std::vector<std::int32_t> group_length_;
  std::vector<std::int64_t> group_begin_;
  std::vector<std::int64_t> diagonal_, coupling_, turned_, row_;
  BlockStructure rest_;
  std::vector<std::int32_t> separators_, in_rest_;
  std::vector<Copy> copies_;
};

}  // namespace cairn::block
