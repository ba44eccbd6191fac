// SPDX-License-Identifier: BSD-3-Clause
#include "small_graph.hpp"

#include <algorithm>
#include <bit>
#include <limits>

namespace cairn::incremental {
namespace {

constexpr std::int32_t kGroupStep = 1 << 20;
constexpr std::int32_t kEliminated = std::numeric_limits<std::int32_t>::max();

/// visit(node) for every bit that is set, rising.
template <class Visit>
void for_each_bit(const std::uint64_t* words, int count, Visit visit) {
  for (int w = 0; w < count; ++w) {
    for (std::uint64_t rest = words[w]; rest != 0; rest &= rest - 1)
      visit(w * 64 + std::countr_zero(rest));
  }
}

/// As std::popcount, which is a call into a library where the processor need not have the
/// instruction.
std::int32_t count_bits(std::uint64_t word) {
  constexpr std::uint64_t kTwo = 0x3333333333333333, kFour = 0x0F0F0F0F0F0F0F0F;
  word -= (word >> 1) & 0x5555555555555555;
  word = (word & kTwo) + ((word >> 2) & kTwo);
  word = (word + (word >> 4)) & kFour;
  return static_cast<std::int32_t>((word * 0x0101010101010101) >> 56);
}

std::int32_t count_bits(const std::uint64_t* words, int count) {
  std::int32_t sum = 0;
  for (int w = 0; w < count; ++w) sum += count_bits(words[w]);
  return sum;
}

/// The first place of the least key. Two passes, since each is a loop that compilers turn into
/// vector instructions.
int first_least(const std::vector<std::int32_t>& keys) {
  std::int32_t least = kEliminated;
  for (const std::int32_t key : keys) least = std::min(least, key);
  return static_cast<int>(std::find(keys.begin(), keys.end(), least) - keys.begin());
}

}  // namespace

void SmallGraph::reset(int nodes) {
  nodes_ = nodes;
  words_ = (nodes + 63) / 64;
  bits_.assign(static_cast<std::size_t>(nodes) * words_, 0);
}

void SmallGraph::join_all(std::span<const std::int32_t> clique) {
  clique_.assign(words_, 0);
  for (const std::int32_t node : clique) clique_[node >> 6] |= std::uint64_t{1} << (node & 63);
  for (const std::int32_t node : clique) {
    std::uint64_t* to = row(node);
    for (int w = 0; w < words_; ++w) to[w] |= clique_[w];
  }
}

void SmallGraph::order(std::span<const std::uint8_t> group, std::vector<std::int32_t>& order) {
  order.clear();
  key_.resize(nodes_);
  for (int node = 0; node < nodes_; ++node) {
    row(node)[node >> 6] &= ~(std::uint64_t{1} << (node & 63));
    key_[node] = group[node] * kGroupStep + count_bits(row(node), words_);
  }
  clique_.resize(words_);
  for (int k = 0; k < nodes_; ++k) {
    const int pivot = first_least(key_);
    order.push_back(pivot);
    key_[pivot] = kEliminated;
    std::copy_n(row(pivot), words_, clique_.data());
    const std::uint64_t gone = ~(std::uint64_t{1} << (pivot & 63));
    for_each_bit(clique_.data(), words_, [&](int node) {
      std::uint64_t* to = row(node);
      for (int w = 0; w < words_; ++w) to[w] |= clique_[w];
      to[pivot >> 6] &= gone;
      const std::int32_t degree = count_bits(to, words_) - 1;  // without the node itself
      to[node >> 6] &= ~(std::uint64_t{1} << (node & 63));
      key_[node] = group[node] * kGroupStep + degree;
    });
  }
}

}  // namespace cairn::incremental
