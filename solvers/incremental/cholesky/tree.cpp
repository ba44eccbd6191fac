// SPDX-License-Identifier: BSD-3-Clause
#include "tree.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "block/front.hpp"

namespace cairn::incremental {
namespace {

constexpr block::CostModel kCost;

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

// --- the affected part ---

void Tree::clear_affected() {
  for (const std::int32_t n : affected_) nodes_[n].affected = false;
  affected_.clear();
  affected_variables_ = 0;
  for (const std::int32_t v : fresh_) variables_[v].fresh = false;
  fresh_.clear();
}

void Tree::touch(std::int32_t variable) {
  Variable& touched = variables_[variable];
  touched.retired = false;
  if (touched.node < 0) {
    if (!touched.fresh) fresh_.push_back(variable);
    touched.fresh = true;
    return;
  }
  for (std::int32_t n = touched.node; n >= 0 && !nodes_[n].affected; n = nodes_[n].parent) {
    nodes_[n].affected = true;
    affected_.push_back(n);
    affected_variables_ += nodes_[n].own;
  }
}

void Tree::retire(std::int32_t variable) {
  Variable& leaving = variables_[variable];
  assert(leaving.node < 0 || nodes_[leaving.node].affected);
  leaving.retired = true;
}

void Tree::put_affected_children_first() {
  std::ranges::sort(affected_, {}, [&](std::int32_t n) { return nodes_[n].sequence; });
}

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

double Tree::seconds_to_order_anew() const {
  return 1e-9 * (2.0 * now_.cost + 1500.0 * static_cast<double>(now_.variables));
}

bool Tree::worn_out() const {
  const double growth =
      std::max(1.0, static_cast<double>(now_.variables) / std::max(when_ordered_.variables, 100));
  return now_.cost > 1.5 * growth * std::max(when_ordered_.cost, 1e5);
}

// --- which variables make up which node ---

void Tree::restructure(const System& system, const Recency& recency) {
  const auto [members, orphans] = take_down();
  std::vector<std::span<const std::int32_t>> cliques;
  cliques.reserve(orphans.size());
  for (const std::int32_t o : orphans) cliques.push_back(nodes_[o].separator());
  reordering_.compute(system, members, cliques, recency);
  put_up(system, orphans);
  if (orphans.empty()) when_ordered_ = now_;
}

/// The affected nodes go.
Tree::Detached Tree::take_down() {
  Detached detached;
  auto& [members, orphans] = detached;
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
  for (const std::int32_t v : members) variables_[v].node = -1, variables_[v].fresh = false;
  fresh_.clear();
  std::erase_if(members, [&](std::int32_t v) { return variables_[v].retired; });
  std::ranges::sort(members);
  return detached;
}

/// Makes the nodes, children before their parents.
void Tree::put_up(const System& system, std::span<const std::int32_t> orphans) {
  const std::span<const std::int32_t> order = reordering_.order();
  const std::int32_t n = static_cast<std::int32_t>(order.size());
  std::vector<std::int32_t> node_at(order.size(), -1);  // by top
  for (std::int32_t k = 0; k < n; ++k) {
    const std::int32_t top = reordering_.top_of(k);
    if (node_at[top] < 0) node_at[top] = new_node();
    nodes_[node_at[top]].variables.push_back(order[k]);
    variables_[order[k]].node = node_at[top];
  }
  affected_variables_ = n;
  for (std::int32_t k = 0; k < n; ++k) {
    if (reordering_.top_of(k) != k) continue;
    Node& node = nodes_[node_at[k]];
    node.own = static_cast<std::int32_t>(node.variables.size());
    for (const std::int32_t row : reordering_.rows(k)) node.variables.push_back(order[row]);
    node.sequence = next_sequence_++;
    node.affected = true;
    affected_.push_back(node_at[k]);
    if (const std::int32_t parent = reordering_.parent(k); parent >= 0) {
      node.parent = node_at[reordering_.top_of(parent)];
      nodes_[node.parent].children.push_back(node_at[k]);
    }
    lay_out(system, node);
    now_.cost += kCost.time(node.columns, node.below());
    now_.variables += node.own;
  }
  for (std::int32_t k = 0; k < n; ++k) {
    reordering_.for_each_clique(k, [&](std::int32_t o) {
      const std::int32_t parent = node_at[reordering_.top_of(k)];
      nodes_[orphans[o]].parent = parent;
      nodes_[parent].children.push_back(orphans[o]);
    });
  }
  for (const std::int32_t a : affected_) {
    Node& node = nodes_[a];
    connect_children(system, node);
    node.movable =
        std::ranges::all_of(node.own_variables(),
                            [&](std::int32_t v) { return variables_[v].bound == 0; }) &&
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
  now_.cost -= kCost.time(node.columns, node.below());
  now_.variables -= node.own;
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

void Tree::lay_out(const System& system, Node& node) {
  node.columns = node.m = 0;
  node.runs.clear();
  for (std::size_t k = 0; k < node.variables.size(); ++k) {
    const std::int32_t v = node.variables[k], size = system.size(v);
    if (k < static_cast<std::size_t>(node.own)) {
      node.columns += size;
    } else {
      const std::int32_t offset = static_cast<std::int32_t>(system.offset(v));
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
}

void Tree::connect_children(const System& system, const Node& parent) {
  front_row_.resize(variables_.size(), -1);
  std::int32_t row = 0;
  for (const std::int32_t v : parent.variables) {
    front_row_[v] = row;
    row += system.size(v);
  }
  for (const std::int32_t c : parent.children) connect(system, nodes_[c], parent);
  for (const std::int32_t v : parent.variables) front_row_[v] = -1;
}

/// Where the rows of a child's update matrix are in the parent's front.
void Tree::connect(const System& system, Node& child, const Node& parent) {
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
    const std::int32_t target = front_row_[v], size = system.size(v);
    if (target < parent.columns) child.panel_rows += size;
    block::append_rows(child.spreads, 0, source, target, size);
    source += size;
  }
}

// --- what it is ---

bool Tree::below(std::int32_t variable, std::int32_t node) const {
  std::int32_t n = node_of(variable);
  while (n >= 0 && nodes_[n].sequence < nodes_[node].sequence) n = nodes_[n].parent;
  return n == node;
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

}  // namespace cairn::incremental
