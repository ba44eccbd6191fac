// SPDX-License-Identifier: BSD-3-Clause
#include "reordering.hpp"

#include <algorithm>
#include <utility>

#include "block/ordering.hpp"
#include "block/symbolic.hpp"
#include "cairn/linear/block_matrix.hpp"

namespace cairn::incremental {
namespace {

constexpr block::CostModel kCost;
/// Up to so many variables are ordered by exact degrees.
constexpr int kSmall = 1500;
/// So many links away from what has been touched is still near it.
constexpr int kNear = 5;
/// The groups of members.
constexpr std::uint8_t kFirst = 0, kBeforeLast = 1, kLast = 2;

}  // namespace

void Reordering::compute(const System& system, std::span<const std::int32_t> members,
                         Cliques cliques, const Recency& recency) {
  place_.resize(static_cast<std::size_t>(system.variables()), -1);
  const int n = static_cast<int>(members.size());
  for (int k = 0; k < n; ++k) place_[members[k]] = k;
  group(system, members, recency);
  std::size_t clique_entries = 0;
  for (const auto& clique : cliques) clique_entries += clique.size() * clique.size();
  static const bool has_camd =
      std::ranges::find(block::every_ordering_name(), "camd") != block::every_ordering_name().end();
  if (has_camd && n > kSmall && clique_entries < 100 * static_cast<std::size_t>(n)) {
    order_large(system, members, cliques);
  } else {
    order_small(system, members, cliques);
  }
  for (std::int32_t& place : order_) place = members[place];  // now variables by place
  for (int k = 0; k < n; ++k) place_[order_[k]] = k;          // and places by variable
  eliminate(system, cliques);
  merge(system);
  for (const std::int32_t v : order_) place_[v] = -1;
}

/// Which members are ordered last, which before them, and which first.
void Reordering::group(const System& system, std::span<const std::int32_t> members,
                       const Recency& recency) {
  groups_.assign(members.size(), kFirst);
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (recency.touched_at[members[k]] >= recency.since) groups_[k] = kLast;
  }
  add_near(system, members);
  for (const Expected& one : recency.expected) {
    const std::int32_t k = place_[one.variable];
    if (k >= 0) groups_[k] = std::max(groups_[k], one.soon ? kLast : kBeforeLast);
  }
}

/// Adds to the last group those that a few blocks of H lead to from it: a robot that looks at
/// places where it has been will look at the next ones soon.
void Reordering::add_near(const System& system, std::span<const std::int32_t> members) {
  stack_.clear();
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    if (groups_[k] == kLast) stack_.push_back(static_cast<std::int32_t>(k));
  }
  std::size_t begin = 0;
  for (int links = 0; links < kNear; ++links) {
    const std::size_t end = stack_.size();
    for (; begin < end; ++begin) {
      for (const System::Link& link : system.links(members[stack_[begin]])) {
        const std::int32_t other = place_[link.other];
        if (other < 0 || groups_[other] == kLast) continue;
        groups_[other] = kLast;
        stack_.push_back(other);
      }
    }
  }
}

void Reordering::order_small(const System& system, std::span<const std::int32_t> members,
                             Cliques cliques) {
  const int n = static_cast<int>(members.size());
  graph_.reset(n);
  for (int k = 0; k < n; ++k) {
    for (const System::Link& link : system.links(members[k])) {
      if (place_[link.other] > k) graph_.join(k, place_[link.other]);
    }
  }
  for (const auto& clique : cliques) {
    stack_.clear();
    for (const std::int32_t v : clique) stack_.push_back(place_[v]);
    graph_.join_all(stack_);
  }
  graph_.order(groups_, order_);
}

/// By approximate minimum degree, which takes hardly more than linear time.
void Reordering::order_large(const System& system, std::span<const std::int32_t> members,
                             Cliques cliques) {
  std::vector<std::int32_t> sizes;
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (const std::int32_t v : members) {
    sizes.push_back(system.size(v));
    for (const System::Link& link : system.links(v)) {
      if (place_[link.other] > place_[v]) entries.emplace_back(place_[link.other], place_[v]);
    }
  }
  for (const auto& clique : cliques) {
    for (const std::int32_t a : clique) {
      for (const std::int32_t b : clique) {
        if (place_[a] > place_[b]) entries.emplace_back(place_[a], place_[b]);
      }
    }
  }
  const std::vector<std::int32_t> groups(groups_.begin(), groups_.end());
  order_ = block::order(BlockStructure(std::move(sizes), std::move(entries)), "camd", groups);
}

/// The rows of each column of L, by places in the order, without the diagonal.
void Reordering::eliminate(const System& system, Cliques cliques) {
  const std::int32_t n = static_cast<std::int32_t>(order_.size());
  column_begin_.assign(n + 1, 0);
  column_rows_.clear();
  column_parent_.assign(n, -1);
  mark_.assign(n, -1);
  first_child_.assign(n, -1);
  sibling_.assign(n, -1);
  clique_first_.assign(n, -1);
  clique_next_.assign(cliques.size(), -1);
  for (std::size_t c = 0; c < cliques.size(); ++c) {
    std::int32_t first = n;
    for (const std::int32_t v : cliques[c]) first = std::min(first, place_[v]);
    clique_next_[c] = clique_first_[first];
    clique_first_[first] = static_cast<std::int32_t>(c);
  }
  for (std::int32_t k = 0; k < n; ++k) {
    std::int32_t parent = n;
    const auto add = [&](std::int32_t row) {
      if (row <= k || mark_[row] == k) return;
      mark_[row] = k;
      column_rows_.push_back(row);
      parent = std::min(parent, row);
    };
    for (const System::Link& link : system.links(order_[k])) add(place_[link.other]);
    for_each_clique(k, [&](std::int32_t c) {
      for (const std::int32_t v : cliques[c]) add(place_[v]);
    });
    for (std::int32_t c = first_child_[k]; c >= 0; c = sibling_[c]) {
      for (std::int64_t r = column_begin_[c]; r < column_begin_[c + 1]; ++r) add(column_rows_[r]);
    }
    column_begin_[k + 1] = std::ssize(column_rows_);
    if (parent == n) continue;
    column_parent_[k] = parent;
    sibling_[k] = first_child_[parent];
    first_child_[parent] = k;
  }
}

/// Merges columns into supernodes, from the leaves up, as long as one larger front is cheaper than
/// two.
void Reordering::merge(const System& system) {
  const std::int32_t n = static_cast<std::int32_t>(order_.size());
  merged_into_.assign(n, -1);
  scalars_own_.resize(n);
  scalars_below_.assign(n, 0.0);
  for (std::int32_t k = 0; k < n; ++k) {
    scalars_own_[k] = system.size(order_[k]);
    for (std::int64_t r = column_begin_[k]; r < column_begin_[k + 1]; ++r)
      scalars_below_[k] += system.size(order_[column_rows_[r]]);
  }
  for (std::int32_t k = 0; k < n; ++k) {
    for (int merges = 0; merges < 256; ++merges) {
      double best_gain = 0.0;
      std::int32_t best = -1, before_best = -1, before = -1;
      for (std::int32_t c = first_child_[k]; c >= 0; before = c, c = sibling_[c]) {
        const double gain = kCost.time(scalars_own_[c], scalars_below_[c]) +
                            kCost.time(scalars_own_[k], scalars_below_[k]) -
                            kCost.time(scalars_own_[c] + scalars_own_[k], scalars_below_[k]);
        if (gain > best_gain) best_gain = gain, best = c, before_best = before;
      }
      if (best < 0) break;
      merged_into_[best] = k;
      scalars_own_[k] += scalars_own_[best];
      // Its children take its place among those of k.
      std::int32_t* link = before_best < 0 ? &first_child_[k] : &sibling_[before_best];
      *link = sibling_[best];
      for (std::int32_t c = first_child_[best], next; c >= 0; c = next) {
        next = sibling_[c];
        sibling_[c] = first_child_[k];
        first_child_[k] = c;
      }
    }
  }
  top_of_.resize(n);
  for (std::int32_t k = n - 1; k >= 0; --k)
    top_of_[k] = merged_into_[k] < 0 ? k : top_of_[merged_into_[k]];
  for (std::int32_t k = 0; k < n; ++k) {
    if (top_of_[k] == k)
      std::sort(column_rows_.begin() + column_begin_[k],
                column_rows_.begin() + column_begin_[k + 1]);
  }
}

}  // namespace cairn::incremental
