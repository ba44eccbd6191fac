// SPDX-License-Identifier: BSD-3-Clause
// Which variables make up which node: the affected part taken down, ordered anew and put up again.
#include <algorithm>
#include <cassert>
#include <utility>

#include "block/front.hpp"
#include "block/ordering.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "tree.hpp"

namespace cairn::incremental {
namespace {

constexpr block::CostModel kCost;
/// Up to so many variables are ordered by exact degrees.
constexpr int kSmall = 1500;
/// So many links away from what has been touched is still near it.
constexpr int kNear = 5;
/// The groups of members.
constexpr std::uint8_t kFirst = 0, kBeforeLast = 1, kLast = 2;

std::int32_t round_up(std::int32_t value) { return (value + 7) / 8 * 8; }

/// Sets the size without keeping what was there. Small arrays get a little more than they need, so
/// that the next node of that place need not ask for memory.
void make_room(UninitializedVector& buffer, std::int64_t doubles) {
  constexpr std::size_t kLittle = 64;
  const std::size_t size = static_cast<std::size_t>(doubles);
  if (buffer.capacity() < size || buffer.capacity() > 2 * size + 4 * kLittle) {
    buffer = UninitializedVector();
    buffer.reserve(size < 16 * kLittle ? size + kLittle : size);
  }
  buffer.resize(size);
}

}  // namespace

double Tree::affected_cost() const {
  double sum = 0.0;
  for (const std::int32_t n : affected_) sum += kCost.time(nodes_[n].columns, nodes_[n].below());
  return sum;
}

double Tree::cost_to_touch(std::int32_t variable, double limit) const {
  double sum = 0.0;
  for (std::int32_t n = node_of(variable); n >= 0 && !nodes_[n].affected && sum <= limit;
       n = nodes_[n].parent)
    sum += kCost.time(nodes_[n].columns, nodes_[n].below());
  return sum;
}

void Tree::restructure(std::span<const std::int64_t> touched_at, std::int64_t since,
                       std::span<const Expected> expected) {
  take_down(members_, orphans_);
  const int n = static_cast<int>(members_.size());
  group(touched_at, since, expected);
  std::size_t clique_entries = 0;
  for (const std::int32_t o : orphans_)
    clique_entries += nodes_[o].separator().size() * nodes_[o].separator().size();
  static const bool has_camd =
      std::ranges::find(block::every_ordering_name(), "camd") != block::every_ordering_name().end();
  if (has_camd && n > kSmall && clique_entries < 100 * static_cast<std::size_t>(n)) {
    order_large();
  } else {
    order_small();
  }
  for (std::int32_t& place : order_) place = members_[place];  // now variables by place
  for (int k = 0; k < n; ++k) local_[order_[k]] = k;           // and places by variable
  eliminate();
  merge();
  const bool all = orphans_.empty();
  put_up(orphans_);
  if (!all) return;
  cost_when_ordered_ = cost_;
  variables_when_ordered_ = variables_;
}

/// Which members are ordered last, which before them, and which first.
void Tree::group(std::span<const std::int64_t> touched_at, std::int64_t since,
                 std::span<const Expected> expected) {
  groups_.assign(members_.size(), kFirst);
  for (std::size_t k = 0; k < members_.size(); ++k) {
    if (touched_at[members_[k]] >= since) groups_[k] = kLast;
  }
  add_near();
  for (const Expected& one : expected) {
    const std::int32_t k = local_[one.variable];
    if (k >= 0) groups_[k] = std::max(groups_[k], one.soon ? kLast : kBeforeLast);
  }
}

/// Adds to the last group those that a few blocks of H lead to from it: a robot that looks at
/// places where it has been will look at the next ones soon.
void Tree::add_near() {
  stack_.clear();
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    if (groups_[k] == kLast) stack_.push_back(static_cast<std::int32_t>(k));
  }
  std::size_t begin = 0;
  for (int links = 0; links < kNear; ++links) {
    const std::size_t end = stack_.size();
    for (; begin < end; ++begin) {
      for (const System::Link& link : system_->links(members_[stack_[begin]])) {
        const std::int32_t other = local_[link.other];
        if (other < 0 || groups_[other] == kLast) continue;
        groups_[other] = kLast;
        stack_.push_back(other);
      }
    }
  }
}

void Tree::order_small() {
  const int n = static_cast<int>(members_.size());
  graph_.reset(n);
  for (int k = 0; k < n; ++k) {
    for (const System::Link& link : system_->links(members_[k])) {
      if (local_[link.other] > k) graph_.join(k, local_[link.other]);
    }
  }
  for (const std::int32_t o : orphans_) {
    stack_.clear();
    for (const std::int32_t v : nodes_[o].separator()) stack_.push_back(local_[v]);
    graph_.join_all(stack_);
  }
  graph_.order(groups_, order_);
}

/// By approximate minimum degree, which takes hardly more than linear time.
void Tree::order_large() {
  std::vector<std::int32_t> sizes;
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (const std::int32_t v : members_) {
    sizes.push_back(system_->size(v));
    for (const System::Link& link : system_->links(v)) {
      if (local_[link.other] > local_[v]) entries.emplace_back(local_[link.other], local_[v]);
    }
  }
  for (const std::int32_t o : orphans_) {
    for (const std::int32_t a : nodes_[o].separator()) {
      for (const std::int32_t b : nodes_[o].separator()) {
        if (local_[a] > local_[b]) entries.emplace_back(local_[a], local_[b]);
      }
    }
  }
  const std::vector<std::int32_t> groups(groups_.begin(), groups_.end());
  order_ = block::order(BlockStructure(std::move(sizes), std::move(entries)), "camd", groups);
}

double Tree::seconds_to_order_anew() const {
  return 1e-9 * (2.0 * cost_ + 1500.0 * static_cast<double>(variables_));
}

bool Tree::worn_out() const {
  const double growth =
      std::max(1.0, static_cast<double>(variables_) / std::max(variables_when_ordered_, 100));
  return cost_ > 1.5 * growth * std::max(cost_when_ordered_, 1e5);
}

/// The affected nodes go; their variables and the fresh ones are `members`, by rising number, and
/// the children that stay are `orphans`.
void Tree::take_down(std::vector<std::int32_t>& members, std::vector<std::int32_t>& orphans) {
  members.clear();
  orphans.clear();
  for (const std::int32_t n : affected_) {
    unsettled_ += nodes_[n].owes || !nodes_[n].lead.empty();
    const auto own = nodes_[n].own_variables();
    members.insert(members.end(), own.begin(), own.end());
    for (const std::int32_t c : nodes_[n].children) {
      if (!nodes_[c].affected) orphans.push_back(c);
    }
  }
  for (const std::int32_t n : affected_) free_node(n);
  affected_.clear();
  members.insert(members.end(), fresh_.begin(), fresh_.end());
  for (const std::int32_t v : members) node_of_[v] = -1, is_fresh_[v] = 0;
  fresh_.clear();
  std::erase_if(members, [&](std::int32_t v) { return retired_[v] != 0; });
  std::ranges::sort(members);
  for (std::size_t k = 0; k < members.size(); ++k)
    local_[members[k]] = static_cast<std::int32_t>(k);
}

/// The rows of each column of L, by places in the order, without the diagonal.
void Tree::eliminate() {
  const std::int32_t n = static_cast<std::int32_t>(order_.size());
  column_begin_.assign(n + 1, 0);
  column_rows_.clear();
  column_parent_.assign(n, -1);
  mark_.assign(n, -1);
  first_child_.assign(n, -1);
  sibling_.assign(n, -1);
  orphan_first_.assign(n, -1);
  orphan_next_.assign(orphans_.size(), -1);
  for (std::size_t o = 0; o < orphans_.size(); ++o) {
    std::int32_t first = n;
    for (const std::int32_t v : nodes_[orphans_[o]].separator()) first = std::min(first, local_[v]);
    orphan_next_[o] = orphan_first_[first];
    orphan_first_[first] = static_cast<std::int32_t>(o);
  }
  for (std::int32_t k = 0; k < n; ++k) {
    std::int32_t parent = n;
    const auto add = [&](std::int32_t row) {
      if (row <= k || mark_[row] == k) return;
      mark_[row] = k;
      column_rows_.push_back(row);
      parent = std::min(parent, row);
    };
    for (const System::Link& link : system_->links(order_[k])) add(local_[link.other]);
    for (std::int32_t o = orphan_first_[k]; o >= 0; o = orphan_next_[o]) {
      for (const std::int32_t v : nodes_[orphans_[o]].separator()) add(local_[v]);
    }
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
/// two: `top_of_[k]` is the last column of the supernode that column k becomes a part of.
void Tree::merge() {
  const std::int32_t n = static_cast<std::int32_t>(order_.size());
  merged_into_.assign(n, -1);
  scalars_own_.resize(n);
  scalars_below_.assign(n, 0.0);
  for (std::int32_t k = 0; k < n; ++k) {
    scalars_own_[k] = system_->size(order_[k]);
    for (std::int64_t r = column_begin_[k]; r < column_begin_[k + 1]; ++r)
      scalars_below_[k] += system_->size(order_[column_rows_[r]]);
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
}

/// Makes the nodes, children before their parents.
void Tree::put_up(std::span<const std::int32_t> orphans) {
  const std::int32_t n = static_cast<std::int32_t>(order_.size());
  mark_.assign(n, -1);  // from here on: node by its last column
  for (std::int32_t k = 0; k < n; ++k) {
    const std::int32_t top = top_of_[k];
    if (mark_[top] < 0) mark_[top] = new_node();
    Node& node = nodes_[mark_[top]];
    node.variables.push_back(order_[k]);
    node_of_[order_[k]] = mark_[top];
  }
  affected_variables_ = n;
  for (std::int32_t k = 0; k < n; ++k) {
    if (top_of_[k] != k) continue;
    Node& node = nodes_[mark_[k]];
    node.own = static_cast<std::int32_t>(node.variables.size());
    const auto begin = column_rows_.begin() + column_begin_[k],
               end = column_rows_.begin() + column_begin_[k + 1];
    std::sort(begin, end);
    for (auto row = begin; row != end; ++row) node.variables.push_back(order_[*row]);
    node.sequence = next_sequence_++;
    node.affected = true;
    affected_.push_back(mark_[k]);
    if (column_parent_[k] >= 0) {
      node.parent = mark_[top_of_[column_parent_[k]]];
      nodes_[node.parent].children.push_back(mark_[k]);
    }
    lay_out(node);
    cost_ += kCost.time(node.columns, node.below());
    variables_ += node.own;
  }
  for (std::int32_t k = 0; k < n; ++k) {
    for (std::int32_t o = orphan_first_[k]; o >= 0; o = orphan_next_[o]) {
      nodes_[orphans[o]].parent = mark_[top_of_[k]];
      nodes_[mark_[top_of_[k]]].children.push_back(orphans[o]);
    }
  }
  for (const std::int32_t v : order_) local_[v] = -1;
  for (const std::int32_t a : affected_) {
    Node& node = nodes_[a];
    connect_children(node);
    node.movable =
        std::ranges::all_of(node.own_variables(),
                            [&](std::int32_t v) { return (*bound_)[v] == 0; }) &&
        std::ranges::all_of(node.children, [&](std::int32_t c) { return nodes_[c].movable; });
  }
}

std::int32_t Tree::new_node() {
  std::int32_t n;
  if (free_.empty()) {
    n = static_cast<std::int32_t>(nodes_.size());
    nodes_.emplace_back();
  } else {
    n = free_.back();
    free_.pop_back();
  }
  nodes_[n].live = true;
  return n;
}

/// Its arrays keep their memory for the next one, but for the large ones, which count.
void Tree::free_node(std::int32_t n) {
  Node& node = nodes_[n];
  doubles_ -= std::ssize(node.panel) + std::ssize(node.update);
  cost_ -= kCost.time(node.columns, node.below());
  variables_ -= node.own;
  node.variables.clear();
  node.children.clear();
  node.owed.clear();
  node.owes = false;
  node.lead.clear();
  node.own = 0;
  node.parent = -1;
  node.live = node.affected = false;
  node.panel.resize(0);
  node.update.resize(0);
  free_.push_back(n);
}

void Tree::lay_out(Node& node) {
  node.columns = node.m = 0;
  node.runs.clear();
  for (std::size_t k = 0; k < node.variables.size(); ++k) {
    const std::int32_t v = node.variables[k], size = system_->size(v);
    if (k < static_cast<std::size_t>(node.own)) {
      node.columns += size;
    } else {
      const std::int32_t offset = static_cast<std::int32_t>(system_->offset(v));
      block::Run* last = node.runs.empty() ? nullptr : &node.runs.back();
      if (last && last->source + last->length == offset) {
        last->length += size;
      } else {
        node.runs.push_back({offset, node.m, size});
      }
    }
    node.m += size;
  }
  node.stride = round_up(node.m);
  node.settled_at = -1;
  node.owed.assign(static_cast<std::size_t>(node.below()), 0.0);
  make_room(node.panel, std::int64_t{node.stride} * node.columns);
  make_room(node.update, std::int64_t{node.below()} * node.update_stride());
  doubles_ += std::ssize(node.panel) + std::ssize(node.update);
  const std::int64_t room = std::int64_t{node.stride + node.columns} * 8;
  if (std::ssize(front_) < room) front_.resize(room);
}

void Tree::connect_children(const Node& parent) {
  std::int32_t row = 0;
  for (const std::int32_t v : parent.variables) {
    front_row_[v] = row;
    row += system_->size(v);
  }
  for (const std::int32_t c : parent.children) connect(nodes_[c], parent);
  for (const std::int32_t v : parent.variables) front_row_[v] = -1;
}

/// Where the rows of a child's update matrix are in the parent's front.
void Tree::connect(Node& child, const Node& parent) {
  child.rows_above.clear();
  for (const std::int32_t v : child.separator()) {
    assert(front_row_[v] >= 0);
    child.rows_above.push_back(front_row_[v]);
  }
  child.straight = std::ranges::is_sorted(child.rows_above);
  child.spreads.clear();
  child.panel_rows = 0;
  if (!child.straight) return;
  std::int32_t source = 0;
  for (const std::int32_t v : child.separator()) {
    const std::int32_t target = front_row_[v], size = system_->size(v);
    if (target < parent.columns) child.panel_rows += size;
    block::append_rows(child.spreads, 0, source, target, size);
    source += size;
  }
}

}  // namespace cairn::incremental
