// SPDX-License-Identifier: BSD-3-Clause
#include "block/symbolic.hpp"

#include <algorithm>
#include <functional>
#include <numeric>

#include "block/front.hpp"

namespace cairn::block {
namespace {

/// The pattern of P H Pᵀ by rows: for each position the smaller positions that it is joined with.
struct RowPattern {
  std::vector<std::int64_t> begin;
  std::vector<std::int32_t> columns;

  RowPattern(const BlockStructure& structure, std::span<const std::int32_t> position) {
    const int n = structure.blocks();
    begin.assign(n + 1, 0);
    for_each_entry(structure, position, [&](std::int32_t row, std::int32_t) { ++begin[row + 1]; });
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    columns.resize(begin[n]);
    std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
    for_each_entry(structure, position,
                   [&](std::int32_t row, std::int32_t column) { columns[next[row]++] = column; });
  }

  std::span<const std::int32_t> row(std::int32_t i) const {
    return std::span(columns).subspan(begin[i], begin[i + 1] - begin[i]);
  }

 private:
  template <class Visit>
  static void for_each_entry(const BlockStructure& s, std::span<const std::int32_t> position,
                             Visit visit) {
    for (int j = 0; j < s.blocks(); ++j) {
      for (std::int64_t e = s.column_begin()[j] + 1; e < s.column_begin()[j + 1]; ++e) {
        const std::int32_t a = position[s.rows()[e]], b = position[j];
        visit(std::max(a, b), std::min(a, b));
      }
    }
  }
};

/// Elimination tree (Liu 1990), with path compression.
std::vector<std::int32_t> elimination_tree(const RowPattern& pattern, int n) {
  std::vector<std::int32_t> parent(n, -1), ancestor(n, -1);
  for (std::int32_t i = 0; i < n; ++i) {
    for (std::int32_t k : pattern.row(i)) {
      while (k != -1 && k < i) {
        const std::int32_t next = ancestor[k];
        ancestor[k] = i;
        if (next == -1) parent[k] = i;
        k = next;
      }
    }
  }
  return parent;
}

/// A postorder of a forest: element k is the node visited k-th. `rank`: a node of higher rank is
/// visited before its siblings; empty: siblings in the order of their numbers.
std::vector<std::int32_t> postorder(std::span<const std::int32_t> parent,
                                    std::span<const double> rank = {}) {
  const std::int32_t n = static_cast<std::int32_t>(parent.size());
  std::vector<std::int32_t> first_child(n, -1), sibling(n, -1), result, stack, last_first(n);
  for (std::int32_t v = 0; v < n; ++v) last_first[v] = n - 1 - v;
  if (!rank.empty())
    std::ranges::stable_sort(last_first, {}, [&](std::int32_t v) { return rank[v]; });
  for (const std::int32_t v : last_first) {
    if (parent[v] < 0) continue;
    sibling[v] = first_child[parent[v]];
    first_child[parent[v]] = v;
  }
  result.reserve(n);
  for (std::int32_t root = 0; root < n; ++root) {
    if (parent[root] >= 0) continue;
    stack.push_back(root);
    while (!stack.empty()) {
      const std::int32_t v = stack.back();
      if (first_child[v] >= 0) {
        stack.push_back(first_child[v]);
        first_child[v] = sibling[first_child[v]];
      } else {
        result.push_back(v);
        stack.pop_back();
      }
    }
  }
  return result;
}

/// The children of each node of a forest, as lists in the order in which they were appended.
struct Families {
  std::vector<std::int32_t> first, last, next, count;

  explicit Families(std::size_t nodes)
      : first(nodes, -1), last(nodes, -1), next(nodes, -1), count(nodes, 0) {}
  void append(std::int32_t parent, std::int32_t child) {
    (last[parent] < 0 ? first[parent] : next[last[parent]]) = child;
    last[parent] = child;
    ++count[parent];
  }
  /// Takes out a child; its own children come at the end of the list.
  void replace_by_its_children(std::int32_t parent, std::int32_t child) {
    std::int32_t before = -1;
    for (std::int32_t c = first[parent]; c != child; c = next[c]) before = c;
    (before < 0 ? first[parent] : next[before]) = next[child];
    if (last[parent] == child) last[parent] = before;
    count[parent] += count[child] - 1;
    if (count[child] == 0) return;
    (last[parent] < 0 ? first[parent] : next[last[parent]]) = first[child];
    last[parent] = last[child];
  }
};

/// How much of the stack of update matrices each node's subtree needs beyond what it leaves on it:
/// to visit the neediest sibling first keeps the stack smallest (Liu 1986). Children have smaller
/// numbers than their parents; `size`: of each node's update matrix.
std::vector<double> stack_ranks(std::span<const std::int32_t> parent,
                                std::span<const double> size) {
  const std::size_t n = parent.size();
  Families families(n);
  std::vector<std::int32_t> children;
  std::vector<double> peak(n), rank(n);
  for (std::size_t v = 0; v < n; ++v) {
    children.clear();
    for (std::int32_t c = families.first[v]; c >= 0; c = families.next[c]) children.push_back(c);
    std::ranges::stable_sort(children, std::greater{}, [&](std::int32_t c) { return rank[c]; });
    double held = 0.0;
    for (const std::int32_t c : children) {
      peak[v] = std::max(peak[v], held + peak[c]);
      held += size[c];
    }
    peak[v] = std::max(peak[v], held + size[v]);
    rank[v] = peak[v] - size[v];
    if (parent[v] >= 0) families.append(parent[v], static_cast<std::int32_t>(v));
  }
  return rank;
}

std::int32_t round_up(std::int64_t value) { return static_cast<std::int32_t>((value + 7) / 8 * 8); }

}  // namespace

double CostModel::time(double columns, double below) const {
  const double rows = round_up(static_cast<std::int64_t>(columns + below));
  return supernode + panel_entry * rows * columns + panel_flop * columns * columns * rows +
         update_flop * below * (below + 16.0) * columns +
         extend_entry * 0.5 * below * (below + 8.0);
}

Symbolic Symbolic::outline(const BlockStructure& structure,
                           std::span<const std::int32_t> ordering) {
  Symbolic symbolic;
  symbolic.find_order(structure, ordering);
  symbolic.count_rows(structure);
  return symbolic;
}

void Symbolic::complete(const BlockStructure& structure, const CostModel& cost) {
  find_supernodes(structure, cost);
  find_rows(structure);
  lay_out();
  map_children();
  assign_entries(structure);
}

void Symbolic::find_order(const BlockStructure& structure, std::span<const std::int32_t> ordering) {
  const int n = structure.blocks();
  std::vector<std::int32_t> position(n);
  for (int k = 0; k < n; ++k) position[ordering[k]] = k;
  const std::vector<std::int32_t> parent = elimination_tree(RowPattern(structure, position), n);
  const std::vector<std::int32_t> post = postorder(parent);
  std::vector<std::int32_t> new_position(n);
  for (int k = 0; k < n; ++k) new_position[post[k]] = k;
  order_.resize(n);
  position_.resize(n);
  parent_.resize(n);
  for (int k = 0; k < n; ++k) {
    order_[k] = ordering[post[k]];
    position_[order_[k]] = k;
    parent_[k] = parent[post[k]] < 0 ? -1 : new_position[parent[post[k]]];
  }
}

/// Rows of each column of L, by walking each row's subtree: blocks for the tests, scalars for the
/// costs.
void Symbolic::count_rows(const BlockStructure& structure) {
  const std::int32_t n = structure.blocks();
  const auto size_of = [&](std::int32_t p) {
    return static_cast<std::int64_t>(structure.block_size(order_[p]));
  };
  scalar_counts_.resize(n);
  counts_.assign(n, 1);
  for (std::int32_t p = 0; p < n; ++p) scalar_counts_[p] = size_of(p);
  {
    const RowPattern pattern(structure, position_);
    std::vector<std::int32_t> mark(n, -1);
    for (std::int32_t i = 0; i < n; ++i) {
      mark[i] = i;
      for (std::int32_t k : pattern.row(i)) {
        for (; mark[k] != i; k = parent_[k]) {
          mark[k] = i;
          ++counts_[k];
          scalar_counts_[k] += size_of(i);
        }
      }
    }
  }
  for (std::int32_t p = 0; p < n; ++p) {
    for (std::int64_t c = 0; c < size_of(p); ++c) {
      const double count = static_cast<double>(scalar_counts_[p] - c);
      factor_nonzeros += scalar_counts_[p] - c;
      factor_flops += count * count;
    }
  }
}

/// Groups positions into supernodes: first fundamental ones (a column and its parent with the same
/// rows), then children are merged into parents where the cost model says that one larger front is
/// cheaper than two. Merging makes blocks that were not neighbours share a supernode, so the order
/// is renumbered at the end.
void Symbolic::find_supernodes(const BlockStructure& structure, const CostModel& cost) {
  const std::int32_t n = structure.blocks();
  const auto size_of = [&](std::int32_t p) {
    return static_cast<std::int64_t>(structure.block_size(order_[p]));
  };

  // Fundamental supernodes.
  std::vector<std::int32_t> child_count(n, 0);
  for (std::int32_t p = 0; p < n; ++p) {
    if (parent_[p] >= 0) ++child_count[parent_[p]];
  }
  std::vector<std::int32_t> node_of(n),
      last_of;  // supernode of a position; last position of a supernode
  for (std::int32_t p = 0; p < n; ++p) {
    const bool joins =
        p > 0 && parent_[p - 1] == p && counts_[p - 1] == counts_[p] + 1 && child_count[p] == 1;
    if (!joins) last_of.push_back(p);
    last_of.back() = p;
    node_of[p] = static_cast<std::int32_t>(last_of.size()) - 1;
  }
  const std::int32_t nodes = static_cast<std::int32_t>(last_of.size());

  // Merge upwards, in postorder; merged_into leads to the node that a node became part of.
  std::vector<std::int32_t> parent(nodes), merged_into(nodes, -1);
  std::vector<double> columns(nodes, 0.0), below(nodes);
  Families children(nodes);
  for (std::int32_t p = 0; p < n; ++p) columns[node_of[p]] += static_cast<double>(size_of(p));
  for (std::int32_t s = 0; s < nodes; ++s) {
    const std::int32_t last = last_of[s];
    below[s] = static_cast<double>(scalar_counts_[last] - size_of(last));
    parent[s] = parent_[last] < 0 ? -1 : node_of[parent_[last]];
    if (parent[s] >= 0) children.append(parent[s], s);
  }
  for (std::int32_t s = 0; s < nodes; ++s) {
    // Largest overlap first: the child whose rows below are nearest in number to this front adds
    // the fewest zeros.
    bool merged = true;
    while (merged) {
      merged = false;
      double best_gain = 0.0;
      std::int32_t best = -1;
      for (std::int32_t c = children.first[s]; c >= 0; c = children.next[c]) {
        const double gain = cost.time(columns[c], below[c]) + cost.time(columns[s], below[s]) -
                            cost.time(columns[c] + columns[s], below[s]);
        if (gain > best_gain) {
          best_gain = gain;
          best = c;
        }
      }
      if (best < 0) break;
      merged = true;
      merged_into[best] = s;
      columns[s] += columns[best];
      children.replace_by_its_children(s, best);
      if (children.count[s] > 64)
        merged = false;  // a hub: one merge is enough, the search must not become quadratic
    }
  }

  // Renumber: postorder of the merged tree, the blocks of a node in their old order.
  const auto representative = [&](std::int32_t s) {
    while (merged_into[s] >= 0) s = merged_into[s];
    return s;
  };
  std::vector<std::int32_t> rep(nodes), compact(nodes, -1), reps;
  for (std::int32_t s = 0; s < nodes; ++s) {
    rep[s] = representative(s);
    if (rep[s] == s) {
      compact[s] = static_cast<std::int32_t>(reps.size());
      reps.push_back(s);
    }
  }
  std::vector<std::int32_t> tree(reps.size());
  for (std::size_t k = 0; k < reps.size(); ++k) {
    tree[k] = parent[reps[k]] < 0 ? -1 : compact[rep[parent[reps[k]]]];
  }
  std::vector<double> sizes(reps.size());
  for (std::size_t k = 0; k < reps.size(); ++k) sizes[k] = below[reps[k]] * below[reps[k]];
  const std::vector<std::int32_t> post = postorder(tree, stack_ranks(tree, sizes));
  std::vector<std::int32_t> member_begin(reps.size() + 1, 0), members(n);
  for (std::int32_t p = 0; p < n; ++p) ++member_begin[compact[rep[node_of[p]]] + 1];
  std::partial_sum(member_begin.begin(), member_begin.end(), member_begin.begin());
  {
    std::vector<std::int32_t> next(member_begin.begin(), member_begin.end() - 1);
    for (std::int32_t p = 0; p < n; ++p) members[next[compact[rep[node_of[p]]]]++] = p;
  }

  std::vector<std::int32_t> new_order;
  new_order.reserve(n);
  std::vector<std::int32_t> final_index(reps.size());
  supernodes_.resize(reps.size());
  supernode_of_.resize(n);
  for (std::size_t k = 0; k < post.size(); ++k) {
    Supernode& node = supernodes_[k];
    final_index[post[k]] = static_cast<std::int32_t>(k);
    node.block_begin = static_cast<std::int32_t>(new_order.size());
    for (std::int32_t i = member_begin[post[k]]; i < member_begin[post[k] + 1]; ++i) {
      const std::int32_t p = members[i];
      supernode_of_[new_order.size()] = static_cast<std::int32_t>(k);
      new_order.push_back(order_[p]);
    }
    node.block_end = static_cast<std::int32_t>(new_order.size());
  }
  for (std::size_t k = 0; k < post.size(); ++k) {
    supernodes_[k].parent = tree[post[k]] < 0 ? -1 : final_index[tree[post[k]]];
  }
  order_ = std::move(new_order);
  scalar_counts_ = {};
  for (std::int32_t p = 0; p < n; ++p) position_[order_[p]] = p;
  offsets_.assign(n + 1, 0);
  for (std::int32_t p = 0; p < n; ++p) offsets_[p + 1] = offsets_[p] + size_of(p);

  children_begin_.assign(supernodes_.size() + 1, 0);
  for (const Supernode& node : supernodes_) {
    if (node.parent >= 0) ++children_begin_[node.parent + 1];
  }
  std::partial_sum(children_begin_.begin(), children_begin_.end(), children_begin_.begin());
  children_.resize(children_begin_.back());
  std::vector<std::int64_t> next(children_begin_.begin(), children_begin_.end() - 1);
  for (std::size_t k = 0; k < supernodes_.size(); ++k) {
    if (supernodes_[k].parent >= 0)
      children_[next[supernodes_[k].parent]++] = static_cast<std::int32_t>(k);
  }
}

/// The block rows below each supernode: those of H and those of its children, beyond its own
/// blocks.
void Symbolic::find_rows(const BlockStructure& structure) {
  const std::int32_t n = structure.blocks();
  // H by columns in elimination order: for each position the larger positions.
  std::vector<std::int64_t> begin(n + 1, 0);
  std::vector<std::int32_t> entries(structure.entries() - n);
  const auto for_each_entry = [&](auto visit) {
    for (std::int32_t j = 0; j < n; ++j) {
      for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
           ++e) {
        const std::int32_t a = position_[structure.rows()[e]], b = position_[j];
        visit(std::min(a, b), std::max(a, b));
      }
    }
  };
  for_each_entry([&](std::int32_t column, std::int32_t) { ++begin[column + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
  for_each_entry([&](std::int32_t column, std::int32_t row) { entries[next[column]++] = row; });

  std::vector<std::int32_t> mark(n, -1);
  rows_.clear();
  for (std::size_t k = 0; k < supernodes_.size(); ++k) {
    Supernode& node = supernodes_[k];
    node.rows_begin = static_cast<std::int64_t>(rows_.size());
    const auto add = [&](std::int32_t row) {
      if (row < node.block_end || mark[row] == static_cast<std::int32_t>(k)) return;
      mark[row] = static_cast<std::int32_t>(k);
      rows_.push_back(row);
    };
    for (std::int64_t e = begin[node.block_begin]; e < begin[node.block_end]; ++e) add(entries[e]);
    for (const std::int32_t c : children(static_cast<int>(k))) {
      for (std::int64_t r = supernodes_[c].rows_begin; r < supernodes_[c].rows_end; ++r)
        add(rows_[r]);
    }
    std::sort(rows_.begin() + node.rows_begin, rows_.end());
    node.rows_end = static_cast<std::int64_t>(rows_.size());
  }
}

void Symbolic::lay_out() {
  panel_values_ = 0;
  for (Supernode& node : supernodes_) {
    std::int64_t below = 0;
    for (std::int64_t r = node.rows_begin; r < node.rows_end; ++r)
      below += scalars(rows_[r], rows_[r] + 1);
    node.columns = static_cast<std::int32_t>(scalars(node.block_begin, node.block_end));
    node.m = node.columns + static_cast<std::int32_t>(below);
    node.stride = round_up(node.m);
    node.panel = panel_values_;
    panel_values_ += static_cast<std::int64_t>(node.stride) * node.columns;
  }
}

/// For each supernode where its rows below are in the parent's front.
void Symbolic::map_children() {
  for (Supernode& node : supernodes_) {
    node.spreads_begin = static_cast<std::int64_t>(spreads_.size());
    node.panel_rows = 0;
    const Supernode* parent = node.parent >= 0 ? &supernodes_[node.parent] : nullptr;
    std::int64_t parent_row = parent ? parent->rows_begin : 0;
    std::int32_t parent_scalar = parent ? parent->columns : 0;
    std::int32_t local = 0;
    for (std::int64_t r = node.rows_begin; r < node.rows_end; ++r) {
      const std::int32_t row = rows_[r];
      const std::int32_t size = static_cast<std::int32_t>(scalars(row, row + 1));
      if (row < parent->block_end) {
        append_rows(spreads_, node.spreads_begin, local,
                    static_cast<std::int32_t>(scalars(parent->block_begin, row)), size);
        node.panel_rows += size;
      } else {
        for (; rows_[parent_row] != row; ++parent_row) {
          parent_scalar +=
              static_cast<std::int32_t>(scalars(rows_[parent_row], rows_[parent_row] + 1));
        }
        append_rows(spreads_, node.spreads_begin, local, parent_scalar, size);
      }
      local += size;
    }
    node.spreads_end = static_cast<std::int64_t>(spreads_.size());
  }
}

void Symbolic::assign_entries(const BlockStructure& structure) {
  const std::int32_t n = structure.blocks();
  // Entries of H by the supernode of their earlier block.
  struct Entry {
    std::int64_t entry;
    std::int32_t column;  // block column in H
  };
  const auto owner = [&](std::int64_t e, std::int32_t j) {
    return supernode_of_[std::min(position_[structure.rows()[e]], position_[j])];
  };
  assembly_begin_.assign(supernodes_.size() + 1, 0);
  for (std::int32_t j = 0; j < n; ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
      ++assembly_begin_[owner(e, j) + 1];
    }
  }
  std::partial_sum(assembly_begin_.begin(), assembly_begin_.end(), assembly_begin_.begin());
  LongList<Entry> entries(assembly_begin_.back());
  std::vector<std::int64_t> next(assembly_begin_.begin(), assembly_begin_.end() - 1);
  for (std::int32_t j = 0; j < n; ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
      entries[next[owner(e, j)]++] = {e, j};
    }
  }

  assembly_.reserve(entries.size());
  std::vector<std::int32_t> front_row(n);  // of a position, in the front of the supernode at hand
  for (std::size_t k = 0; k < supernodes_.size(); ++k) {
    const Supernode& node = supernodes_[k];
    for (std::int32_t p = node.block_begin; p < node.block_end; ++p) {
      front_row[p] = static_cast<std::int32_t>(scalars(node.block_begin, p));
    }
    std::int32_t row = node.columns;
    for (std::int64_t r = node.rows_begin; r < node.rows_end; ++r) {
      front_row[rows_[r]] = row;
      row += static_cast<std::int32_t>(scalars(rows_[r], rows_[r] + 1));
    }
    for (std::int64_t e = assembly_begin_[k]; e < assembly_begin_[k + 1]; ++e) {
      const std::int32_t i = structure.rows()[entries[e].entry], j = entries[e].column;
      const bool transpose = position_[i] < position_[j];
      const std::int32_t upper = transpose ? position_[i] : position_[j];
      const std::int32_t lower = transpose ? position_[j] : position_[i];
      assembly_.push_back({.source = structure.value_begin()[entries[e].entry],
                           .target = node.panel +
                                     static_cast<std::int64_t>(front_row[upper]) * node.stride +
                                     front_row[lower],
                           .rows = static_cast<std::int16_t>(structure.block_size(i)),
                           .columns = static_cast<std::int16_t>(structure.block_size(j)),
                           .stride = node.stride,
                           .transpose = transpose});
    }
  }
}

}  // namespace cairn::block
