// SPDX-License-Identifier: BSD-3-Clause
#include "tree.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "block/ordering.hpp"
#include "cairn/block_matrix.hpp"

namespace cairn::incremental {
namespace {

constexpr block::CostModel kCost;
/// Up to so many variables are ordered by exact degrees.
constexpr int kSmall = 1500;

std::int32_t round_up(std::int32_t value) { return (value + 7) / 8 * 8; }

/// Sets the size without keeping what was there.
void make_room(UninitializedVector& buffer, std::int64_t doubles) {
  const std::size_t size = static_cast<std::size_t>(doubles);
  if (buffer.capacity() < size || buffer.capacity() > 2 * size + 64) {
    buffer = UninitializedVector(size);
  } else {
    buffer.resize(size);
  }
}

/// Adds the row `target` of a parent's front to the spreads of the child whose row is `source`.
void spread_row(std::vector<block::Spread>& spreads, std::int32_t source, std::int32_t target) {
  const std::int32_t first = target / 8 * 8;
  if (spreads.empty() || spreads.back().target != first) spreads.push_back({source, first, 0, 0});
  block::Spread& spread = spreads.back();
  spread.mask = static_cast<std::uint8_t>(spread.mask | 1u << (target - first));
  spread.packed = static_cast<std::uint8_t>(spread.packed << 1 | 1u);
}

}  // namespace

Tree::Tree(const Tree& other, const System& system, States& states,
           const std::vector<std::int32_t>& bound)
    : Tree(other) {
  system_ = &system;
  states_ = &states;
  bound_ = &bound;
}

// --- the affected part ---

void Tree::clear_affected() {
  for (const std::int32_t n : affected_) nodes_[n].affected = false;
  affected_.clear();
  affected_variables_ = 0;
  for (const std::int32_t v : fresh_) is_fresh_[v] = 0;
  fresh_.clear();
}

void Tree::make_room_for_variables() {
  const std::size_t size = static_cast<std::size_t>(system_->variables());
  if (node_of_.size() >= size) return;
  node_of_.resize(size, -1);
  is_fresh_.resize(size, 0);
  retired_.resize(size, 0);
  local_.resize(size, -1);
  front_row_.resize(size, -1);
}

void Tree::touch(std::int32_t variable) {
  make_room_for_variables();
  retired_[variable] = 0;
  if (node_of_[variable] < 0) {
    if (!is_fresh_[variable]) fresh_.push_back(variable);
    is_fresh_[variable] = 1;
    return;
  }
  for (std::int32_t n = node_of_[variable]; n >= 0 && !nodes_[n].affected; n = nodes_[n].parent) {
    nodes_[n].affected = true;
    affected_.push_back(n);
    affected_variables_ += nodes_[n].own;
  }
}

void Tree::retire(std::int32_t variable) {
  make_room_for_variables();
  assert(node_of_[variable] < 0 || nodes_[node_of_[variable]].affected);
  retired_[variable] = 1;
}

// --- restructuring ---

void Tree::restructure(std::span<const std::int64_t> touched_at, std::int64_t since) {
  take_down(members_, orphans_);
  const int n = static_cast<int>(members_.size());
  groups_.resize(n);
  std::size_t clique_entries = 0;
  for (int k = 0; k < n; ++k) groups_[k] = touched_at[members_[k]] >= since;
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
  node.arrived_at = 0;
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
    for (std::int32_t k = 0; k < size; ++k) spread_row(child.spreads, source++, target + k);
  }
}

// --- numbers ---

std::int32_t Tree::factorize() {
  std::ranges::sort(affected_, {}, [&](std::int32_t n) { return nodes_[n].sequence; });
  for (const std::int32_t n : affected_) {
    if (factorize_node(nodes_[n])) continue;
    const Node& node = nodes_[n];
    for (const std::int32_t v : node.own_variables()) {
      const std::int32_t row = front_row(node, v);
      for (std::int32_t c = row; c < row + system_->size(v); ++c) {
        const double pivot = node.panel[std::int64_t{c} * node.stride + c];
        if (!(pivot > 0.0) || !std::isfinite(pivot)) return v;
      }
    }
    return node.variables.front();
  }
  return -1;
}

/// H's entries into the panel.
void Tree::assemble(Node& node) {
  double* panel = node.panel.data();
  const std::int64_t stride = node.stride;
  std::fill(node.panel.begin(), node.panel.end(), 0.0);
  std::int32_t row = 0;
  for (const std::int32_t v : node.variables) {
    front_row_[v] = row;
    row += system_->size(v);
  }
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system_->size(v), at = front_row_[v];
    double* columns = panel + at * stride;
    const double* diagonal = system_->diagonal(v);
    for (std::int32_t c = 0; c < size; ++c) {
      for (std::int32_t r = 0; r < size; ++r) columns[c * stride + at + r] = *diagonal++;
    }
    for (const System::Link& link : system_->links(v)) {
      const std::int32_t other = front_row_[link.other];
      if (other < at) continue;  // in a subtree, or done from the other side
      const std::int32_t rows = system_->size(link.other);
      const double* block = system_->block(link.entry);
      if (link.other < v) {
        for (std::int32_t c = 0; c < size; ++c) {
          for (std::int32_t r = 0; r < rows; ++r) columns[c * stride + other + r] = *block++;
        }
      } else {
        for (std::int32_t r = 0; r < rows; ++r) {
          for (std::int32_t c = 0; c < size; ++c) columns[c * stride + other + r] = *block++;
        }
      }
    }
  }
}

/// A child whose separator has another order than the front: block by block. Into the panel and
/// what is there of the update matrix, which must have been computed.
void Tree::add_scattered(const Node& child, Node& parent) {
  const std::int32_t shift = child.columns / 8 * 8;
  double* const panel = parent.panel.data();
  double* const update = parent.update.data();
  // Element (row, column) of the parent's front, row ≥ column.
  const auto place = [&](std::int32_t row, std::int32_t column) -> double& {
    return column < parent.columns ? panel[std::int64_t{column} * parent.stride + row]
                                   : update[parent.update_place(row, column)];
  };
  std::int32_t j = 0;
  const auto separator = child.separator();
  for (std::size_t b = 0; b < separator.size(); ++b) {
    const std::int32_t width = system_->size(separator[b]), to_j = front_row_[separator[b]];
    std::int32_t i = j;
    for (std::size_t a = b; a < separator.size(); ++a) {
      const std::int32_t height = system_->size(separator[a]), to_i = front_row_[separator[a]];
      for (std::int32_t c = 0; c < width; ++c) {
        const double* column = child.update.data() + std::int64_t{j + c} * child.update_stride() +
                               (i + child.columns - shift);
        for (std::int32_t r = a == b ? c : 0; r < height; ++r) {
          place(std::max(to_i + r, to_j + c), std::min(to_i + r, to_j + c)) += column[r];
        }
      }
      i += height;
    }
    j += width;
  }
}

bool Tree::factorize_node(Node& node) {
  assemble(node);
  double* panel = node.panel.data();
  double* update = node.update.data();
  const bool inner = node.below() > 0;
  const std::int64_t stride = node.stride, update_stride = node.update_stride();
  // The update matrix starts with what comes from children; the product is taken off it later.
  bool scattered = false;
  for (const std::int32_t c : node.children) {
    const Node& child = nodes_[c];
    if (!child.straight) {
      scattered = true;
      continue;
    }
    kernels_->extend_add(child.spreads.data(), static_cast<int>(child.spreads.size()), 0,
                         child.panel_rows, child.update.data() + child.columns % 8,
                         child.update_stride(), panel, stride);
  }
  UninitializedVector children_part;
  if (scattered) {
    // Panel and update matrix at once: the latter into zeros, to be added after the product.
    if (inner) std::fill(node.update.begin(), node.update.end(), 0.0);
    for (const std::int32_t c : node.children) {
      if (!nodes_[c].straight) add_scattered(nodes_[c], node);
    }
    if (inner) std::swap(children_part, node.update), node.update.resize(children_part.size());
    update = node.update.data();
  }
  for (const std::int32_t v : node.variables) front_row_[v] = -1;

  int failed = -1;
  constexpr int kStrip = 48;
  if (std::int64_t{node.m} * node.m <= 256 * 256) {
    failed = kernels_->factor_panel(panel, stride, 0, node.columns, node.stride);
  } else {
    for (int first = 0; first < node.columns; first += kStrip) {
      const int last = std::min(node.columns, first + kStrip);
      const int below = std::min(node.stride, (last + 7) / 8 * 8);
      const int column = kernels_->factor_panel(panel, stride, first, last, below);
      if (failed < 0) failed = column;
      kernels_->factor_rows(panel, stride, first, last, below, node.stride);
    }
  }
  if (failed >= 0) return false;
  if (!inner) return true;
  kernels_->update(panel, stride, node.columns, node.m, update, node.columns / 8 * 8, node.stride);
  for (std::size_t k = 0; k < children_part.size(); ++k) update[k] += children_part[k];
  double* front = update - node.columns * update_stride - node.columns / 8 * 8;
  for (const std::int32_t c : node.children) {
    const Node& child = nodes_[c];
    if (!child.straight) continue;
    kernels_->extend_add(child.spreads.data(), static_cast<int>(child.spreads.size()),
                         child.panel_rows, child.below(), child.update.data() + child.columns % 8,
                         child.update_stride(), front, update_stride);
  }
  return true;
}

// --- substitution ---

/// Solves for a node's own variables, given y (null: zero) and what it owes, and hands the steps of
/// its front on to its children.
void Tree::solve_node(Node& node, const double* y, std::vector<double>& steps,
                      std::vector<std::int32_t>& changed) {
  double* const front = front_.data();
  double* const own = front + node.stride;
  double* next = own;
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system_->size(v);
    if (y) {
      std::copy_n(y + system_->offset(v), size, next);
    } else {
      std::fill_n(next, size, 0.0);
    }
    next += size;
  }
  std::ranges::copy(node.owed, front + node.columns);
  kernels_->backward(node.panel.data(), node.stride, node.columns, node.m, own, nullptr, 0, nullptr,
                     front);
  std::copy_n(own, node.columns, front);
  next = own;
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system_->size(v);
    double* step = steps.data() + system_->offset(v);
    for (std::int32_t k = 0; k < size; ++k) step[k] += next[k];
    next += size;
    changed.push_back(v);
  }
  std::ranges::fill(node.owed, 0.0);
  node.owes = false;
  node.arrived_at = 0;
  for (const std::int32_t c : node.children) {
    Node& child = nodes_[c];
    child.arrived.resize(child.owed.size());
    double *owed = child.owed.data(), *arrived = child.arrived.data();
    const auto separator = child.separator();
    for (std::size_t k = 0; k < separator.size(); ++k) {
      const std::int32_t size = system_->size(separator[k]);
      const double* step = front + child.rows_above[k];
      for (std::int32_t i = 0; i < size; ++i) {
        *owed++ += step[i];
        *arrived++ = step[i];
      }
    }
    child.owes = true;
    child.arrived_at = pass_;
  }
}

// --- moving as a whole ---

/// Takes the motion of the separator as a whole out of what a node owes, if little is then left.
bool Tree::move_as_a_whole(Node& node, double tolerance) {
  const auto separator = node.separator();
  const LieGroup& group = *states_->type(separator.front()).lie_group();
  const std::int32_t size = system_->size(separator.front()), square = size * size;
  const std::int32_t ambient = states_->ambient(separator.front());
  rigid_.resize(node.owed.size());
  matrix_.resize(static_cast<std::size_t>(square));
  twist_.resize(static_cast<std::size_t>(std::int64_t{size} + 2 * ambient));
  double* const twist = twist_.data();
  double* const element = twist + size;
  const auto multiply = [&](const double* vector, double* out) {
    for (std::int32_t r = 0; r < size; ++r) {
      double sum = 0.0;
      for (std::int32_t c = 0; c < size; ++c) sum += matrix_[c * size + r] * vector[c];
      out[r] = sum;
    }
  };
  // The motion is that of the separator's first variable: ξ = Ad(x_0) δ_0 …
  group.adjoint(states_->x(separator.front()), matrix_.data());
  multiply(node.owed.data(), twist);
  // … and would be δ_i = Ad(x_i⁻¹) ξ of the others.
  double left = 0.0;
  const double* owed = node.owed.data();
  double* rigid = rigid_.data();
  for (const std::int32_t v : separator) {
    group.inverse(states_->x(v), element);
    group.adjoint(element, matrix_.data());
    multiply(twist, rigid);
    const double* weight = system_->diagonal(v);
    for (std::int32_t k = 0; k < size; ++k) {
      const double rest = owed[k] - rigid[k];
      left += weight[k * (size + 1)] * rest * rest;
    }
    if (left > tolerance) return false;
    owed += size;
    rigid += size;
  }
  // x exp(rigid + rest) = x exp(rigid) exp(D rest): what is left is counted from where the motion
  // has brought x.
  double *rest = node.owed.data(), *arrived = node.arrived.data();
  rigid = rigid_.data();
  for (const std::int32_t v : separator) {
    states_->type(v).retract_jacobian(states_->x(v), rigid, matrix_.data());
    for (std::int32_t k = 0; k < size; ++k) arrived[k] -= rest[k], rest[k] -= rigid[k];
    multiply(rest, rigid);
    for (std::int32_t k = 0; k < size; ++k) rest[k] = rigid[k], arrived[k] += rest[k];
    rest += size;
    arrived += size;
    rigid += size;
  }
  group.exp(twist, element);
  add_lead(node, element);
  return true;
}

/// All of the subtree is to be moved by g, after what it is to be moved by already.
void Tree::add_lead(Node& node, const double* g) {
  const std::int32_t v = node.variables.front(), ambient = states_->ambient(v);
  states_->log_other(static_cast<std::int32_t>(&node - nodes_.data()), node.lead);
  if (node.lead.empty()) {
    node.lead.assign(g, g + ambient);
  } else {
    states_->type(v).lie_group()->compose(g, node.lead.data(), node.lead.data());
  }
}

/// Moves a node's own variables by what its subtree is to be moved by, and leaves the rest of it to
/// its children.
void Tree::hand_down(Node& node) {
  if (node.lead.empty()) return;
  for (const std::int32_t v : node.own_variables()) states_->lead(v, node.lead.data());
  for (const std::int32_t c : node.children) add_lead(nodes_[c], node.lead.data());
  states_->log_other(static_cast<std::int32_t>(&node - nodes_.data()), node.lead);
  node.lead.clear();
}

void Tree::settle(std::int32_t variable) {
  stack_.clear();
  bool any = false;
  for (std::int32_t n = node_of(variable); n >= 0; n = nodes_[n].parent) {
    stack_.push_back(n);
    any = any || !nodes_[n].lead.empty();
  }
  if (!any) return;
  for (std::size_t k = stack_.size(); k-- > 0;) hand_down(nodes_[stack_[k]]);
}

void Tree::settle_all() {
  top_down(stack_);
  for (const std::int32_t n : stack_) hand_down(nodes_[n]);
}

const Node* Tree::end_of_pass(std::int32_t variable) const {
  for (std::int32_t n = node_of(variable); n >= 0; n = nodes_[n].parent) {
    if (nodes_[n].arrived_at == pass_) return &nodes_[n];
  }
  return nullptr;
}

const double* Tree::arrived(const Node& node, std::int32_t variable) const {
  const double* at = node.arrived.data();
  for (const std::int32_t v : node.separator()) {
    if (v == variable) return at;
    at += system_->size(v);
  }
  return nullptr;
}

/// What a node owes, squared and weighted with the diagonal of H.
double Tree::owed_square(const Node& node) const {
  double sum = 0.0;
  const double* owed = node.owed.data();
  for (const std::int32_t v : node.separator()) {
    const std::int32_t size = system_->size(v);
    const double* weight = system_->diagonal(v);
    for (std::int32_t k = 0; k < size; ++k) sum += weight[k * (size + 1)] * owed[k] * owed[k];
    owed += size;
  }
  return sum;
}

/// g ← L⁻¹ g along `path_`; returns the square of its norm.
double Tree::forward(std::vector<double>& g) {
  double square = 0.0;
  double* const own = front_.data();
  for (const std::int32_t n : path_) {
    const Node& node = nodes_[n];
    double* const front = own + node.stride;
    double* next = own;
    for (const std::int32_t v : node.own_variables()) {
      std::copy_n(g.data() + system_->offset(v), system_->size(v), next);
      next += system_->size(v);
    }
    kernels_->forward(node.panel.data(), node.stride, node.columns, own, node.runs.data(),
                      static_cast<int>(node.runs.size()), g.data(), front);
    for (std::int32_t c = 0; c < node.columns; ++c) square += own[c] * own[c];
    next = own;
    for (const std::int32_t v : node.own_variables()) {
      std::copy_n(next, system_->size(v), g.data() + system_->offset(v));
      next += system_->size(v);
    }
  }
  return square;
}

double Tree::decrement(std::span<const std::int32_t> sources, std::vector<double>& g) {
  collect_paths(sources);
  const auto for_each_value = [&](auto visit) {
    std::size_t k = 0;
    for (const std::int32_t n : path_) {
      for (const std::int32_t v : nodes_[n].own_variables()) {
        double* value = g.data() + system_->offset(v);
        for (std::int32_t i = 0; i < system_->size(v); ++i) visit(value[i], k++);
      }
    }
  };
  kept_.resize(g.size());
  for_each_value([&](double value, std::size_t k) { kept_[k] = value; });
  const double square = forward(g);
  for_each_value([&](double& value, std::size_t k) { value = kept_[k]; });
  return square;
}

double Tree::solve(std::span<const std::int32_t> sources, double tolerance, std::vector<double>& g,
                   std::vector<double>& steps, std::vector<std::int32_t>& changed) {
  collect_paths(sources);
  const double square = forward(g);
  ++pass_;
  for (const std::int32_t n : path_) on_path_[n] = 1;
  stack_.clear();
  for (const std::int32_t n : path_) {
    if (nodes_[n].parent < 0) stack_.push_back(n);
  }
  while (!stack_.empty()) {
    const std::int32_t n = stack_.back();
    stack_.pop_back();
    Node& node = nodes_[n];
    const double enough = tolerance * static_cast<double>(node.separator().size());
    if (!on_path_[n] &&
        (owed_square(node) <= enough || (node.movable && move_as_a_whole(node, enough)))) {
      continue;
    }
    hand_down(node);
    solve_node(node, on_path_[n] ? g.data() : nullptr, steps, changed);
    if (on_path_[n]) {
      for (const std::int32_t v : node.own_variables())
        std::fill_n(g.data() + system_->offset(v), system_->size(v), 0.0);
    }
    on_path_[n] = 0;
    stack_.insert(stack_.end(), node.children.begin(), node.children.end());
  }
  return square;
}

void Tree::follow(std::int32_t variable, std::vector<double>& steps,
                  std::vector<std::int32_t>& changed) {
  stack_.clear();
  bool any = false;
  for (std::int32_t n = node_of(variable); n >= 0; n = nodes_[n].parent) {
    stack_.push_back(n);
    any = any || nodes_[n].owes;
  }
  settle(variable);
  if (!any) return;
  ++pass_;
  stack_.clear();
  for (std::int32_t n = node_of(variable); n >= 0; n = nodes_[n].parent) stack_.push_back(n);
  for (std::size_t k = stack_.size(); k-- > 0;) {
    if (nodes_[stack_[k]].owes) solve_node(nodes_[stack_[k]], nullptr, steps, changed);
  }
}

std::int32_t Tree::front_row(const Node& node, std::int32_t variable) const {
  std::int32_t row = 0;
  for (const std::int32_t v : node.variables) {
    if (v == variable) return row;
    row += system_->size(v);
  }
  return -1;
}

double Tree::log_determinant() const {
  double sum = 0.0;
  for (const Node& node : nodes_) {
    if (!node.live) continue;
    for (std::int64_t c = 0; c < node.columns; ++c)
      sum += std::log(node.panel[c * node.stride + c]);
  }
  return 2.0 * sum;
}

void Tree::top_down(std::vector<std::int32_t>& nodes) const {
  nodes.clear();
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (nodes_[n].live && nodes_[n].parent < 0) nodes.push_back(static_cast<std::int32_t>(n));
  }
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const auto& children = nodes_[nodes[k]].children;
    nodes.insert(nodes.end(), children.begin(), children.end());
  }
}

// --- eight right-hand sides ---

namespace {

/// own ↔ the rows of X that are a node's own.
template <class Copy>
void for_each_own(const System& system, const Node& node, double* own, double* X, Copy copy) {
  for (const std::int32_t v : node.own_variables()) {
    const std::int64_t doubles = std::int64_t{system.size(v)} * 8;
    copy(own, X + system.offset(v) * 8, doubles);
    own += doubles;
  }
}

}  // namespace

/// The nodes on the paths from these variables to the roots, children first.
void Tree::collect_paths(std::span<const std::int32_t> sources) {
  path_.clear();
  on_path_.resize(nodes_.size(), 0);
  for (const std::int32_t v : sources) {
    for (std::int32_t n = node_of(v); n >= 0 && !on_path_[n]; n = nodes_[n].parent) {
      on_path_[n] = 1;
      path_.push_back(n);
    }
  }
  for (const std::int32_t n : path_) on_path_[n] = 0;
  std::ranges::sort(path_, {}, [&](std::int32_t n) { return nodes_[n].sequence; });
}

void Tree::forward_many(std::span<const std::int32_t> sources, AlignedVector& X) {
  collect_paths(sources);
  for (const std::int32_t n : path_) {
    const Node& node = nodes_[n];
    double* own = front_.data();
    double* front = own + std::int64_t{node.columns} * 8;
    for_each_own(*system_, node, own, X.data(),
                 [](double* a, double* b, std::int64_t size) { std::copy_n(b, size, a); });
    kernels_->forward_many(node.panel.data(), node.stride, node.columns, own, node.runs.data(),
                           static_cast<int>(node.runs.size()), X.data(), front);
    for_each_own(*system_, node, own, X.data(),
                 [](double* a, double* b, std::int64_t size) { std::copy_n(a, size, b); });
  }
}

void Tree::backward_many(const Node& node, AlignedVector& X) {
  double* own = front_.data();
  double* front = own + std::int64_t{node.columns} * 8;
  for_each_own(*system_, node, own, X.data(),
               [](double* a, double* b, std::int64_t size) { std::copy_n(b, size, a); });
  kernels_->backward_many(node.panel.data(), node.stride, node.columns, node.m, own,
                          node.runs.data(), static_cast<int>(node.runs.size()), X.data(), front);
  for_each_own(*system_, node, own, X.data(),
               [](double* a, double* b, std::int64_t size) { std::copy_n(a, size, b); });
}

void Tree::solve_many(std::span<const std::int32_t> sources, AlignedVector& X) {
  forward_many(sources, X);
  top_down(stack_);
  for (const std::int32_t n : stack_) backward_many(nodes_[n], X);
}

void Tree::solve_many_above(std::span<const std::int32_t> sources, AlignedVector& X) {
  forward_many(sources, X);
  for (std::size_t k = path_.size(); k-- > 0;) backward_many(nodes_[path_[k]], X);
}

}  // namespace cairn::incremental
