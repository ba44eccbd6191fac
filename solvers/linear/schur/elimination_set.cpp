// SPDX-License-Identifier: BSD-3-Clause
#include "elimination_set.hpp"

#include <algorithm>
#include <numeric>
#include <span>

namespace cairn::schur {
namespace {

/// A block with more neighbours than so many times the mean is a hub.
constexpr double kHub = 2.0;

/// Who is joined with whom, both ways, without the diagonal.
class Neighbours {
 public:
  explicit Neighbours(const BlockStructure& structure) : begin_(structure.blocks() + 1, 0) {
    for_each_pair(structure, [&](std::int32_t i, std::int32_t j) {
      ++begin_[i + 1];
      ++begin_[j + 1];
    });
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    blocks_.resize(begin_.back());
    std::vector<std::int64_t> next(begin_.begin(), begin_.end() - 1);
    for_each_pair(structure, [&](std::int32_t i, std::int32_t j) {
      blocks_[next[i]++] = j;
      blocks_[next[j]++] = i;
    });
  }

  std::int64_t count(std::int32_t block) const { return begin_[block + 1] - begin_[block]; }
  double mean() const {
    return static_cast<double>(blocks_.size()) / static_cast<double>(begin_.size() - 1);
  }
  std::span<const std::int32_t> of(std::int32_t block) const {
    return std::span(blocks_).subspan(begin_[block], count(block));
  }

 private:
  template <class Visit>
  static void for_each_pair(const BlockStructure& s, Visit visit) {
    for (std::int32_t j = 0; j < s.blocks(); ++j) {
      for (std::int64_t e = s.column_begin()[j] + 1; e < s.column_begin()[j + 1]; ++e)
        visit(s.rows()[e], j);
    }
  }

  std::vector<std::int64_t> begin_;
  std::vector<std::int32_t> blocks_;
};

std::vector<std::int32_t> blocks_of_smallest_size(const BlockStructure& structure) {
  const std::int32_t smallest = *std::ranges::min_element(structure.sizes());
  std::vector<std::int32_t> blocks;
  for (std::int32_t b = 0; b < structure.blocks(); ++b) {
    if (structure.block_size(b) == smallest) blocks.push_back(b);
  }
  return blocks;
}

/// Takes the candidates in turn, fewest neighbours first, unless a neighbour is taken already: each
/// of its eliminations then fills in little.
std::vector<std::int32_t> greedy(const Neighbours& neighbours, int blocks,
                                 std::vector<std::int32_t> candidates) {
  std::ranges::stable_sort(candidates, {},
                           [&](std::int32_t block) { return neighbours.count(block); });
  std::vector<bool> barred(blocks, false);
  std::vector<std::int32_t> taken;
  for (const std::int32_t block : candidates) {
    if (barred[block]) continue;
    taken.push_back(block);
    for (const std::int32_t other : neighbours.of(block)) barred[other] = true;
  }
  return taken;
}

std::vector<std::int32_t> chosen(const BlockStructure& structure, std::string_view how) {
  const int blocks = structure.blocks();
  const Neighbours neighbours(structure);
  if (how != "independent_set") {
    std::vector<std::int32_t> candidates = blocks_of_smallest_size(structure);
    std::vector<std::int32_t> taken = greedy(neighbours, blocks, candidates);
    const bool independent = taken.size() == candidates.size();
    const bool many = 2 * taken.size() >= static_cast<std::size_t>(blocks);
    if (how == "smallest" || (independent && many)) return taken;
  }
  // A hub, such as a landmark seen from everywhere, joins all its neighbours when it goes: it
  // stays.
  const double most = kHub * neighbours.mean();
  std::vector<std::int32_t> candidates;
  for (std::int32_t b = 0; b < blocks; ++b) {
    if (static_cast<double>(neighbours.count(b)) <= most) candidates.push_back(b);
  }
  return greedy(neighbours, blocks, std::move(candidates));
}

}  // namespace

std::vector<std::int32_t> elimination_set(const BlockStructure& structure, std::string_view how) {
  if (structure.blocks() == 0) return {};
  std::vector<std::int32_t> set = chosen(structure, how);
  std::ranges::sort(
      set, {}, [&](std::int32_t block) { return std::pair(structure.block_size(block), block); });
  return set;
}

}  // namespace cairn::schur
