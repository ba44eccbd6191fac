// SPDX-License-Identifier: BSD-3-Clause
#include "block/supernodal_cholesky.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>

#include "block/ordering.hpp"
#include "cairn/error.hpp"
#include "cairn/threads.hpp"

namespace cairn::block {
namespace {

/// A front with more update flops than this is worth cutting into tiles for several threads.
constexpr double kParallelFront = 2e6;
/// Rows of one such tile.
constexpr int kTileRows = 96;
/// Subtrees are cut until none holds more than this part of all work (when there is more than a
/// little of it).
constexpr double kLargestSubtree = 1.0 / 16.0;
constexpr double kSmallestTask = 2e5;

double work_of(const Supernode& node) {
  const double columns = node.columns, below = node.m - node.columns;
  return 4000.0 + columns * columns * node.m + 1.5 * below * below * columns;
}

/// Assigns places in one array to update matrices that live from their supernode to its parent:
/// first fit.
class Places {
 public:
  std::int64_t take(std::int64_t size) {
    for (auto it = free_.begin(); it != free_.end(); ++it) {
      if (it->second < size) continue;
      const std::int64_t begin = it->first, left = it->second - size;
      free_.erase(it);
      if (left > 0) free_.emplace(begin + size, left);
      return begin;
    }
    // A free stretch at the end may grow.
    std::int64_t begin = end_;
    if (!free_.empty()) {
      const auto last = std::prev(free_.end());
      if (last->first + last->second == end_) {
        begin = last->first;
        free_.erase(last);
      }
    }
    end_ = begin + size;
    return begin;
  }
  void give_back(std::int64_t begin, std::int64_t size) {
    if (size == 0) return;
    auto [it, added] = free_.emplace(begin, size);
    const auto next = std::next(it);
    if (next != free_.end() && it->first + it->second == next->first) {
      it->second += next->second;
      free_.erase(next);
    }
    if (it != free_.begin()) {
      const auto before = std::prev(it);
      if (before->first + before->second == it->first) {
        before->second += it->second;
        free_.erase(it);
      }
    }
  }
  std::int64_t end() const { return end_; }

 private:
  std::map<std::int64_t, std::int64_t> free_;
  std::int64_t end_ = 0;
};

}  // namespace

SupernodalCholesky::SupernodalCholesky(std::string_view kernels)
    : kernels_(choose_kernels(std::string(kernels).c_str())) {
  if (!kernels_) {
    throw Error(ErrorCode::usage,
                "this machine cannot run the kernels '" + std::string(kernels) + "'; use auto");
  }
}

void SupernodalCholesky::analyze(const BlockStructure& structure, std::string_view ordering,
                                 const CostModel& cost) {
  factorized_ = false;
  if (ordering == "auto") {
    ordering_.clear();
    for (const std::string& name : ordering_names()) {
      if (name == "natural") continue;
      Symbolic candidate(structure, order(structure, name), cost);
      if (!ordering_.empty() && candidate.factor_flops >= symbolic_.factor_flops) continue;
      symbolic_ = std::move(candidate);
      ordering_ = name;
    }
  } else {
    symbolic_ = Symbolic(structure, order(structure, ordering), cost);
    ordering_ = ordering;
  }
  structure_ = &structure;
  version_ = structure.version();
  panels_.resize(symbolic_.panel_values());
  failed_.assign(symbolic_.supernodes().size(), -1);
  permuted_.resize(structure.size());
  std::int32_t largest = 0;
  for (const Supernode& node : symbolic_.supernodes()) largest = std::max(largest, node.stride);
  front_vector_.resize(largest);
  plan_parallel();
  plan_workspace();
}

/// Cuts the forest into subtrees of about equal work, and the rest above them. Independent of the
/// number of threads.
void SupernodalCholesky::plan_parallel() {
  const auto nodes = symbolic_.supernodes();
  const std::int32_t count = static_cast<std::int32_t>(nodes.size());
  std::vector<double> work(count, 0.0);
  std::vector<std::int32_t> first(count);  // first supernode of the subtree below each
  double total = 0.0;
  for (std::int32_t s = 0; s < count; ++s) first[s] = s;
  for (std::int32_t s = 0; s < count; ++s) {
    const double own = work_of(nodes[s]);
    total += own;
    work[s] += own;
    if (nodes[s].parent >= 0) {
      work[nodes[s].parent] += work[s];
      first[nodes[s].parent] = std::min(first[nodes[s].parent], first[s]);
    }
  }
  const double limit = std::max(kSmallestTask, total * kLargestSubtree);
  subtrees_.clear();
  top_.clear();
  for (std::int32_t s = 0; s < count; ++s) {
    const bool small = work[s] <= limit;
    const bool parent_small = nodes[s].parent >= 0 && work[nodes[s].parent] <= limit;
    if (!small) top_.push_back(s);
    if (!small || parent_small) continue;
    // Neighbouring small subtrees share a task.
    if (!subtrees_.empty() && subtrees_.back().end == first[s] &&
        subtrees_.back().work + work[s] <= limit) {
      subtrees_.back().end = s + 1;
      subtrees_.back().work += work[s];
    } else {
      subtrees_.push_back({first[s], s + 1, work[s]});
    }
  }
}

void SupernodalCholesky::plan_workspace() {
  const auto nodes = symbolic_.supernodes();
  update_begin_.assign(nodes.size(), 0);
  std::int64_t end = 0;
  std::vector<bool> inside(nodes.size(), false);
  const auto rounded = [](std::int64_t size) { return (size + 7) / 8 * 8; };
  for (const Subtree& subtree : subtrees_) {
    // Tasks run at the same time: each has a stretch of its own, reused within it.
    Places places;
    for (std::int32_t s = subtree.begin; s < subtree.end; ++s) {
      inside[s] = true;
      update_begin_[s] = end + places.take(rounded(nodes[s].update_size()));
      for (const std::int32_t c : symbolic_.children(s)) {
        places.give_back(update_begin_[c] - end, rounded(nodes[c].update_size()));
      }
    }
    end += places.end();
  }
  // Above the subtrees one supernode is worked off after the other; a place is free again after its
  // parent, unless it lies in a subtree's stretch.
  Places places;
  for (const std::int32_t s : top_) {
    update_begin_[s] = end + places.take(rounded(nodes[s].update_size()));
    for (const std::int32_t c : symbolic_.children(s)) {
      if (!inside[c]) places.give_back(update_begin_[c] - end, rounded(nodes[c].update_size()));
    }
  }
  workspace_.resize(end + places.end() + 8);  // `extend_add` may read beyond
}

Factorization SupernodalCholesky::factorize(const BlockMatrix& H) {
  if (!structure_ || H.structure().version() != version_) {
    throw std::logic_error("factorize: analyze this structure first");
  }
  for_each_chunk(subtrees_.size(), [&](std::size_t task) {
    for (std::int32_t s = subtrees_[task].begin; s < subtrees_[task].end; ++s)
      factorize_supernode(H, s, false);
  });
  for (const std::int32_t s : top_) factorize_supernode(H, s, true);

  factorized_ = true;
  const auto failed =
      std::ranges::find_if(failed_, [](std::int32_t column) { return column >= 0; });
  if (failed == failed_.end()) return {};
  factorized_ = false;
  const Supernode& node = symbolic_.supernodes()[failed - failed_.begin()];
  const auto offsets = symbolic_.offsets();
  std::int32_t position = node.block_begin;
  while (offsets[position + 1] - offsets[node.block_begin] <= *failed) ++position;
  return {.ok = false, .failed_block = symbolic_.order()[position]};
}

void SupernodalCholesky::update(const Supernode& node, double* U, bool parallel_inside) {
  const double* panel = panels_.data() + node.panel;
  const int begin = node.columns / 8 * 8, rows = node.stride - begin;
  const double below = node.m - node.columns;
  if (!parallel_inside || below * below * node.columns < kParallelFront) {
    kernels_->update(panel, node.stride, node.columns, node.m, U, begin, node.stride);
    return;
  }
  const int tiles = (rows + kTileRows - 1) / kTileRows;
  for_each_chunk(tiles, [&](std::size_t tile) {
    // The last tiles have the longest rows: hand them out first.
    const int first = begin + (tiles - 1 - static_cast<int>(tile)) * kTileRows;
    kernels_->update(panel, node.stride, node.columns, node.m, U, first,
                     std::min(node.stride, first + kTileRows));
  });
}

void SupernodalCholesky::factorize_supernode(const BlockMatrix& H, std::int32_t s,
                                             bool parallel_inside) {
  const auto nodes = symbolic_.supernodes();
  const Supernode& node = nodes[s];
  double* panel = panels_.data() + node.panel;
  double* U = workspace_.data() + update_begin_[s];
  const auto children = symbolic_.children(s);
  // Adds columns [first, last) of a child to the panel or, beyond it, to the update matrix.
  const auto add_child = [&](std::int32_t c, int first, int last, double* parent,
                             std::int64_t parent_stride) {
    const Supernode& child = nodes[c];
    kernels_->extend_add(symbolic_.spreads().data() + child.spreads_begin,
                         static_cast<int>(child.spreads_end - child.spreads_begin), first, last,
                         workspace_.data() + update_begin_[c] + child.columns % 8,
                         child.update_stride(), parent, parent_stride);
  };

  const auto entries = symbolic_.assembly(s);
  kernels_->assemble(entries.data(), static_cast<int>(entries.size()), H.values().data(),
                     panels_.data(), panel, std::int64_t{node.stride} * node.columns);
  for (const std::int32_t c : children) add_child(c, 0, nodes[c].panel_rows, panel, node.stride);
  failed_[s] = kernels_->factor_panel(panel, node.stride, node.columns);
  if (node.m == node.columns) return;
  update(node, U, parallel_inside);
  // U as if it were a part of the whole front.
  const std::int64_t stride = node.update_stride();
  double* front = U - node.columns * stride - node.columns / 8 * 8;
  for (const std::int32_t c : children)
    add_child(c, nodes[c].panel_rows, nodes[c].m - nodes[c].columns, front, stride);
}

void SupernodalCholesky::solve(std::span<const double> g, std::span<double> x) {
  if (!factorized_) throw std::logic_error("solve: there is no factorisation");
  const auto order = symbolic_.order();
  const auto offsets = symbolic_.offsets();
  const auto from = structure_->offsets();
  double* p = permuted_.data();
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::int64_t size = offsets[k + 1] - offsets[k];
    std::copy_n(g.data() + from[order[k]], size, p + offsets[k]);
  }

  const auto nodes = symbolic_.supernodes();
  const Run* gathers = symbolic_.gathers().data();
  double* front = front_vector_.data();
  for (const Supernode& node : nodes) {
    kernels_->forward(panels_.data() + node.panel, node.stride, node.columns,
                      p + offsets[node.block_begin], gathers + node.gather_begin,
                      static_cast<int>(node.gather_end - node.gather_begin), p, front);
  }
  for (std::size_t s = nodes.size(); s-- > 0;) {
    const Supernode& node = nodes[s];
    kernels_->backward(panels_.data() + node.panel, node.stride, node.columns, node.m,
                       p + offsets[node.block_begin], gathers + node.gather_begin,
                       static_cast<int>(node.gather_end - node.gather_begin), p, front);
  }
  for (std::size_t k = 0; k < order.size(); ++k) {
    std::copy_n(p + offsets[k], offsets[k + 1] - offsets[k], x.data() + from[order[k]]);
  }
}

double SupernodalCholesky::log_determinant() const {
  if (!factorized_) throw std::logic_error("log_determinant: there is no factorisation");
  double sum = 0.0;
  for (const Supernode& node : symbolic_.supernodes()) {
    const double* panel = panels_.data() + node.panel;
    for (std::int32_t j = 0; j < node.columns; ++j)
      sum += std::log(panel[static_cast<std::int64_t>(j) * node.stride + j]);
  }
  return 2.0 * sum;
}

}  // namespace cairn::block
