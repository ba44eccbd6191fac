// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace cairn::incremental {

/// An undirected graph of a few hundred or thousand nodes as a bit matrix, to be eliminated: what
/// an update orders anew. On graphs as small as these, joining two neighbourhoods is a handful of
/// machine words, and the exact degree a count of bits; quotient graphs repay later.
class SmallGraph {
 public:
  /// `nodes` nodes, no edges. Keeps its memory from one use to the next.
  void reset(int nodes);
  int nodes() const { return nodes_; }
  void join(int a, int b) {
    row(a)[b >> 6] |= std::uint64_t{1} << (b & 63);
    row(b)[a >> 6] |= std::uint64_t{1} << (a & 63);
  }
  /// Joins all of them with each other.
  void join_all(std::span<const std::int32_t> clique);

  /// Minimum degree, every degree exact. Nodes with a smaller `group` go first; a tie is decided
  /// for the lower number. The graph is used up. order[k] is the node that is eliminated k-th.
  void order(std::span<const std::uint8_t> group, std::vector<std::int32_t>& order);

 private:
  std::uint64_t* row(int node) { return bits_.data() + static_cast<std::size_t>(node) * words_; }

  int nodes_ = 0;
  int words_ = 0;
  std::vector<std::uint64_t> bits_;
  std::vector<std::uint64_t> clique_;
  std::vector<std::int32_t> key_;  // degree, and the group above it; eliminated: the largest number
};

}  // namespace cairn::incremental
