// SPDX-License-Identifier: BSD-3-Clause
#include "block/chains.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "block/block_graph.hpp"

namespace cairn::block {
namespace {

/// Lengths of chains. Few of them, so that the lanes of groups are full.
constexpr std::size_t kLengths[] = {24, 16, 12, 8, 6, 4, 3, 2, 1};
/// With less than this part of all blocks on chains, or fewer blocks, there are none.
constexpr double kLeastPart = 0.3;
constexpr std::size_t kFewestNodes = 100;

std::size_t longest_within(std::size_t nodes) {
  return *std::ranges::find_if(kLengths, [&](std::size_t length) { return length <= nodes; });
}

/// Paths of blocks that may be on chains.
class Paths {
 public:
  Paths(const BlockGraph& graph, std::vector<bool>& on_path)
      : graph_(graph), on_path_(on_path), visited_(on_path.size(), false) {}

  struct Path {
    std::vector<std::int32_t> nodes;
    std::int32_t before = -1, after = -1;  ///< the separators
  };

  /// The path through a block that was on none so far; empty if it was.
  Path through(std::int32_t block) {
    if (!on_path_[block] || visited_[block]) return {};
    // Back to the first block of the path, then along it.
    std::int32_t at = block, from = -1;
    for (;;) {
      const std::int32_t next = step(at, from);
      if (next < 0 || !on_path_[next]) break;
      if (next == block) {  // a cycle without a separator: this block becomes one
        on_path_[block] = false;
        return through(graph_.of(block)[0]);
      }
      from = std::exchange(at, next);
    }
    Path path;
    from = step(at, from);  // the separator, or none
    path.before = from;
    while (at >= 0 && on_path_[at]) {
      visited_[at] = true;
      path.nodes.push_back(at);
      from = std::exchange(at, step(at, from));
    }
    path.after = at;
    if (path.nodes.front() > path.nodes.back()) {
      std::ranges::reverse(path.nodes);
      std::swap(path.before, path.after);
    }
    return path;
  }

 private:
  /// The neighbour of `at` that is not `from`, or -1.
  std::int32_t step(std::int32_t at, std::int32_t from) const {
    for (const std::int32_t next : graph_.of(at)) {
      if (next != from) return next;
    }
    return -1;
  }

  const BlockGraph& graph_;
  std::vector<bool>& on_path_;
  std::vector<bool> visited_;
};

}  // namespace

Chains::Chains(const BlockStructure& structure, int lanes) : lanes_(lanes) {
  const std::int32_t n = structure.blocks();
  const auto of_size = [&](std::int32_t size) {
    return std::ranges::count(structure.sizes(), size);
  };
  size_ = of_size(6) > of_size(3) ? 6 : 3;
  const BlockGraph graph(structure);
  std::vector<bool> on_path(n);
  std::size_t candidates = 0;
  for (std::int32_t b = 0; b < n; ++b) {
    const auto neighbours = graph.of(b);
    on_path[b] = structure.block_size(b) == size_ && neighbours.size() <= 2 &&
                 std::ranges::all_of(neighbours, [&](std::int32_t other) {
                   return structure.block_size(other) == size_;
                 });
    candidates += on_path[b] ? 1 : 0;
  }
  const auto pays = [&](std::size_t nodes) {
    return nodes >= kFewestNodes && static_cast<double>(nodes) >= kLeastPart * n;
  };
  if (!pays(candidates)) return;

  in_rest_.assign(n, 0);
  Paths paths(graph, on_path);
  for (std::int32_t b = 0; b < n; ++b) {
    const Paths::Path path = paths.through(b);
    const std::size_t count = path.nodes.size();
    std::int32_t before = path.before;
    for (std::size_t begin = 0; begin < count;) {
      const std::size_t left = count - begin;
      // The ends of a chain differ.
      const bool closed = before >= 0 && before == path.after;
      const std::size_t length = longest_within(closed ? left - 1 : left);
      const std::size_t end = begin + length;
      Chain& chain = chains_.emplace_back();
      chain.first = before;
      chain.last = end < count ? path.nodes[end] : path.after;
      chain.begin = nodes_.size();
      chain.length = length;
      nodes_.insert(nodes_.end(), path.nodes.begin() + static_cast<std::ptrdiff_t>(begin),
                    path.nodes.begin() + static_cast<std::ptrdiff_t>(end));
      before = chain.last;
      begin = end + 1;
    }
  }
  for (const std::int32_t node : nodes_) in_rest_[node] = -1;
  if (!pays(nodes_.size()) || std::ssize(nodes_) == n) {
    chains_.clear();
    return;
  }
  build_rest(structure);
  group_equal_lengths();
  place_numbers(structure);
}

void Chains::build_rest(const BlockStructure& structure) {
  std::vector<std::int32_t> sizes;
  for (std::int32_t b = 0; b < structure.blocks(); ++b) {
    if (in_rest_[b] < 0) continue;
    in_rest_[b] = static_cast<std::int32_t>(separators_.size());
    separators_.push_back(b);
    sizes.push_back(structure.block_size(b));
  }
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  entries.reserve(static_cast<std::size_t>(structure.entries() - structure.blocks()) +
                  chains_.size());
  const auto for_each_entry = [&](auto visit) {
    for (const std::int32_t j : separators_) {
      for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
        if (const std::int32_t i = in_rest_[structure.rows()[e]]; i >= 0) visit(e, i, in_rest_[j]);
      }
    }
  };
  for_each_entry([&](std::int64_t, std::int32_t i, std::int32_t j) {
    if (i != j) entries.emplace_back(i, j);
  });
  for (Chain& chain : chains_) {
    if (chain.first >= 0) chain.first = in_rest_[chain.first];
    if (chain.last >= 0) chain.last = in_rest_[chain.last];
    if (chain.first >= 0 && chain.last >= 0) entries.emplace_back(chain.first, chain.last);
  }
  rest_ = BlockStructure(std::move(sizes), std::move(entries));
  const auto place = [&](std::int32_t i, std::int32_t j) {
    return i < 0 || j < 0 ? -1 : rest_.value_begin()[rest_.find(std::max(i, j), std::min(i, j))];
  };
  for (Chain& chain : chains_) {
    chain.first_block = place(chain.first, chain.first);
    chain.last_block = place(chain.last, chain.last);
    chain.common_block = place(chain.first, chain.last);
    chain.turned = chain.first > chain.last;
  }
  // Entries that follow one another on both sides are one stretch.
  for_each_entry([&](std::int64_t e, std::int32_t i, std::int32_t j) {
    const std::int64_t source = structure.value_begin()[e],
                       target = rest_.value_begin()[rest_.find(i, j)],
                       size = structure.value_begin()[e + 1] - source;
    if (!copies_.empty()) {
      Copy& last = copies_.back();
      if (last.source + last.size == source && last.target + last.size == target) {
        last.size += size;
        return;
      }
    }
    copies_.push_back({source, target, size});
  });
}

void Chains::group_equal_lengths() {
  std::int64_t used = 0;
  for (const std::size_t length : kLengths) {
    int lane = lanes_;
    for (Chain& chain : chains_) {
      if (chain.length != length) continue;
      if (lane == lanes_) {
        lane = 0;
        group_begin_.push_back(used);
        group_length_.push_back(static_cast<std::int32_t>(length));
        used += static_cast<std::int64_t>(length) * lanes_;
      }
      chain.group = groups() - 1;
      chain.lane = lane++;
    }
  }
  group_begin_.push_back(used);
}

void Chains::place_numbers(const BlockStructure& structure) {
  const auto total = static_cast<std::size_t>(group_begin_.back());
  const std::size_t couplings = total + group_length_.size() * static_cast<std::size_t>(lanes_);
  diagonal_.assign(total, ChainGroup::kIdentity);
  row_.assign(total, ChainGroup::kZero);
  coupling_.assign(couplings, ChainGroup::kZero);
  turned_.assign(couplings, 0);
  for (const Chain& chain : chains_) {
    const auto place = [&](std::size_t k) {
      return static_cast<std::size_t>(group_begin_[chain.group]) +
             k * static_cast<std::size_t>(lanes_) + static_cast<std::size_t>(chain.lane);
    };
    const auto group_offset =
        static_cast<std::size_t>(chain.group) * static_cast<std::size_t>(lanes_);
    const auto nodes = chain.nodes(*this);
    const auto block_at = [&](std::size_t k) {  // k = 0: before the first node
      if (k == 0) return chain.first < 0 ? -1 : separators_[chain.first];
      if (k <= nodes.size()) return nodes[k - 1];
      return chain.last < 0 ? -1 : separators_[chain.last];
    };
    for (std::size_t k = 0; k <= nodes.size(); ++k) {
      const std::int32_t a = block_at(k), b = block_at(k + 1);
      if (k < nodes.size()) {
        diagonal_[place(k)] = structure.value_begin()[structure.column_begin()[nodes[k]]];
        row_[place(k)] = structure.offsets()[nodes[k]];
      }
      if (a < 0 || b < 0) continue;
      const std::int64_t entry = structure.find(std::max(a, b), std::min(a, b));
      coupling_[group_offset + place(k)] = structure.value_begin()[entry];
      turned_[group_offset + place(k)] = a > b ? -1 : 0;
    }
  }
}

ChainGroup Chains::group(int g) const {
  const std::int64_t begin = group_begin_[g], couplings = begin + std::int64_t{g} * lanes_;
  return {group_length_[g], diagonal_.data() + begin, coupling_.data() + couplings,
          turned_.data() + couplings, row_.data() + begin};
}

}  // namespace cairn::block
