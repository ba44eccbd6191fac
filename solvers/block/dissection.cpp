// SPDX-License-Identifier: BSD-3-Clause
#include "block/dissection.hpp"

#include <algorithm>
#include <iterator>
#include <new>
#include <utility>

#include <metis.h>

#include "block/block_graph.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::block {
namespace {

using Blocks = std::vector<std::int32_t>;

/// Cuts a graph by vertex separators, recursively, into pieces that may be eliminated without each
/// other, and numbers pieces and separators as groups for CAMD: a separator comes after what it
/// separates. Minimum degree is left to CAMD, which sees the whole graph and so counts the degrees
/// at the edge of a piece rightly; METIS's own minimum degree sees a piece as if it were alone.
class Dissection {
 public:
  Dissection(const BlockStructure& structure, std::span<const std::int32_t> outer)
      : sizes_(structure.sizes()), groups_(structure.blocks(), 0), local_(structure.blocks(), -1) {
    METIS_SetDefaultOptions(options_);
    options_[METIS_OPTION_SEED] = 1;  // the same groups every time
    options_[METIS_OPTION_NUMBERING] = 0;
    options_[METIS_OPTION_UFACTOR] = kImbalance;
    const BlockGraph graph(structure);
    near_.reserve(structure.blocks());
    for (std::int32_t b = 0; b < structure.blocks(); ++b)
      near_.emplace_back(graph.of(b).begin(), graph.of(b).end());

    const Blocks of_outer =
        outer.empty() ? Blocks(structure.blocks(), 0) : Blocks(outer.begin(), outer.end());
    std::vector<Blocks> members;
    for (std::int32_t b = 0; b < structure.blocks(); ++b) {
      members.resize(std::max(members.size(), static_cast<std::size_t>(of_outer[b]) + 1));
      members[of_outer[b]].push_back(b);
    }
    for (const Blocks& part : members) dissect(without_the_easy(part, of_outer));
  }
  Blocks& groups() { return groups_; }

 private:
  /// How much heavier than the other than one half may be, in thousandths: a thin separator is
  /// worth more than equal halves.
  static constexpr int kImbalance = 300;
  /// Pieces of so few blocks are not cut any more.
  static constexpr std::size_t kPiece = 150;
  /// A block with so few neighbours is eliminated before everything else in its group.
  static constexpr std::size_t kEasy = 3;
  /// The lists of blocks with more neighbours are too long to be searched again and again.
  static constexpr std::size_t kHub = 64;

  /// Eliminates blocks with very few neighbours, which any good ordering does, as a first group.
  /// What is left is cut faster: of a pose graph often half, of a trajectory with few loops a
  /// quarter.
  Blocks without_the_easy(const Blocks& part, const Blocks& of_outer) {
    const std::int32_t group = next_group_++;
    const std::int32_t outer = of_outer[part.front()];
    std::vector<bool> gone(near_.size(), false);
    Blocks stack(part.rbegin(), part.rend());
    while (!stack.empty()) {
      const std::int32_t block = stack.back();
      stack.pop_back();
      if (gone[block] || !easy(block)) continue;
      gone[block] = true;
      groups_[block] = group;
      for (const std::int32_t other : near_[block]) {
        Blocks& list = near_[other];
        std::erase(list, block);
        for (const std::int32_t third : near_[block]) {
          if (third != other && std::ranges::find(list, third) == list.end()) list.push_back(third);
        }
        if (of_outer[other] == outer && list.size() <= kEasy) stack.push_back(other);
      }
    }
    Blocks left;
    std::ranges::copy_if(part, std::back_inserter(left), [&](auto block) { return !gone[block]; });
    return left;
  }

  bool easy(std::int32_t block) const {
    return near_[block].size() <= kEasy && std::ranges::all_of(near_[block], [&](auto other) {
             return near_[other].size() <= kHub;
           });
  }

  void dissect(const Blocks& piece) {
    if (piece.size() <= kPiece) return close(piece);
    std::vector<idx_t> begin{0}, neighbours, weights;
    for (std::size_t k = 0; k < piece.size(); ++k) local_[piece[k]] = static_cast<std::int32_t>(k);
    for (const std::int32_t block : piece) {
      for (const std::int32_t other : near_[block]) {
        if (local_[other] >= 0) neighbours.push_back(local_[other]);
      }
      begin.push_back(static_cast<idx_t>(neighbours.size()));
      weights.push_back(sizes_[block]);
    }
    for (const std::int32_t block : piece) local_[block] = -1;
    if (neighbours.empty()) return close(piece);  // METIS wants at least one edge

    auto n = static_cast<idx_t>(piece.size());
    idx_t separator = 0;
    std::vector<idx_t> side(piece.size());
    const int status = METIS_ComputeVertexSeparator(
        &n, begin.data(), neighbours.data(), weights.data(), options_, &separator, side.data());
    if (status == METIS_ERROR_MEMORY) throw std::bad_alloc();
    if (status != METIS_OK) {
      throw Error(ErrorCode::usage, "METIS refused the block graph; use ordering=amd");
    }
    Blocks parts[3];  // the halves and what separates them
    for (std::size_t k = 0; k < piece.size(); ++k) parts[side[k]].push_back(piece[k]);
    if (parts[0].empty() || parts[1].empty()) return close(piece);
    dissect(parts[0]);
    dissect(parts[1]);
    close(parts[2]);
  }

  void close(const Blocks& piece) {
    for (const std::int32_t block : piece) groups_[block] = next_group_;
    ++next_group_;
  }

  std::span<const std::int32_t> sizes_;
  idx_t options_[METIS_NOPTIONS];
  std::vector<Blocks> near_;  // neighbours, with the edges that easy blocks leave behind
  Blocks groups_;
  Blocks local_;  // number in the piece at hand, or -1
  std::int32_t next_group_ = 0;
};

}  // namespace

std::vector<std::int32_t> dissection(const BlockStructure& structure,
                                     std::span<const std::int32_t> outer) {
  return std::move(Dissection(structure, outer).groups());
}

}  // namespace cairn::block
