// SPDX-License-Identifier: BSD-3-Clause
#include "block/selected_inverse.hpp"

#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "block/front.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::block {
namespace {

int round_up(int rows) { return (rows + 7) / 8 * 8; }

/// Columns of T, or of a child's Z_RR, that one task of a large front computes.
constexpr std::size_t kTileColumns = 48;

}  // namespace

/// Room, once per analysis.
void SelectedInverse::prepare() {
  if (analysis_ == cholesky_->analyses_) return;
  panels_ = UninitializedVector(cholesky_->symbolic_.panel_values());
  lane_room_ = 0;
  supernode_of_.assign(cholesky_->symbolic_.order().size(), 0);
  for (std::int32_t s = 0; s < std::ssize(nodes()); ++s) {
    const Supernode& node = nodes()[s];
    lane_room_ = std::max(lane_room_, room_to_invert(node.columns, node.m));
    std::fill(supernode_of_.begin() + node.block_begin, supernode_of_.begin() + node.block_end, s);
  }
  room_ = UninitializedVector(lane_room_ * cholesky_->schedule_.lanes);
  placement_ = cholesky_->schedule_.by_levels(cholesky_->symbolic_);
  auto& workspace = cholesky_->double_.workspace;
  if (std::ssize(workspace) < placement_.size) {
    workspace = {};
    workspace.resize(placement_.size);
  }
  analysis_ = cholesky_->analyses_;
}

void SelectedInverse::compute() {
  if (!cholesky_->double_.factorized) throw std::logic_error("inverse: there is no factorisation");
  prepare();
  const Schedule& schedule = cholesky_->schedule_;
  if (schedule.lanes == 1) {
    for (std::int32_t s = static_cast<std::int32_t>(nodes().size()); s-- > 0;) invert(s, 0);
    return;
  }
  for (std::size_t l = schedule.levels.size(); l-- > 0;) {
    for (const std::int32_t s : schedule.levels[l])
      is_large(nodes()[s].m) ? invert_large(s) : invert(s, 0);
  }
  std::atomic<std::size_t> next{0};
  const auto lane_loop = [&](std::size_t lane) {
    for (std::size_t t = next++; t < schedule.tasks.size(); t = next++) {
      for (std::int32_t s = schedule.tasks[t].end; s-- > schedule.tasks[t].begin;)
        invert(s, static_cast<std::int64_t>(lane));
    }
  };
  for_each_chunk(static_cast<std::size_t>(schedule.lanes), lane_loop);
}

/// Z in the columns of one supernode, and Z_RR of its children.
void SelectedInverse::invert(std::int32_t s, std::int64_t lane) {
  const Supernode& node = nodes()[s];
  invert_front(*cholesky_->kernels_, cholesky_->double_.panels.data() + node.panel, node.stride,
               node.columns, node.m, rest(s, lane), panel(s), room_.data() + lane * lane_room_);
  for (const std::int32_t child : cholesky_->symbolic_.children(s)) {
    const int rows = nodes()[child].m - nodes()[child].columns;
    hand_down(s, child, lane, 0, rows);
    mirror(child, lane, nodes()[child].panel_rows, rows);
  }
}

/// The same for a large front above the tasks, cut into tiles that any thread works off.
void SelectedInverse::invert_large(std::int32_t s) {
  const Kernels& kernels = *cholesky_->kernels_;
  const Supernode& node = nodes()[s];
  const double* L = cholesky_->double_.panels.data() + node.panel;
  const int c8 = round_up(node.columns), rows = node.m - node.columns;
  const int below = node.columns / 8 * 8;
  double* V = room_.data();
  double* T = V + std::int64_t{c8} * node.columns;
  const auto tiles = [](int size, auto body) {
    for_each_range(static_cast<std::size_t>(size), kTileColumns,
                   [&](std::size_t begin, std::size_t end) {
                     body(static_cast<int>(begin), static_cast<int>(end));
                   });
  };
  std::fill(V, T, 0.0);
  tiles(c8, [&](int begin, int end) {
    kernels.invert_pivots(L, node.stride, node.columns, V, begin, end);
  });
  tiles(rows, [&](int begin, int end) {
    kernels.transform_rows(L, node.stride, node.columns, V, T, begin, end);
  });
  if (rows > 0) {
    tiles(node.stride - below, [&](int begin, int end) {
      kernels.inverse_rows(rest(s, 0), node.stride, node.columns, node.m, T, panel(s),
                           below + begin, below + end);
    });
  }
  tiles(c8, [&](int begin, int end) {
    kernels.inverse_pivots(V, T, node.stride, node.columns, node.m, panel(s), begin, end);
  });
  for (const std::int32_t child : cholesky_->symbolic_.children(s)) {
    const int size = nodes()[child].m - nodes()[child].columns;
    tiles(size, [&](int begin, int end) { hand_down(s, child, 0, begin, end); });
    tiles(size, [&](int begin, int end) {
      mirror(child, 0, std::max(begin, nodes()[child].panel_rows), end);
    });
  }
}

/// Columns [first, last) of a child's Z_RR: those that are columns of this supernode come out of
/// its panel with all their rows, the others out of its own Z_RR with the rows that are in there.
void SelectedInverse::hand_down(std::int32_t s, std::int32_t child, std::int64_t lane, int first,
                                int last) {
  const Kernels& kernels = *cholesky_->kernels_;
  const Supernode& node = nodes()[s];
  const Supernode& to = nodes()[child];
  const Spread* spreads = cholesky_->symbolic_.spreads().data() + to.spreads_begin;
  const int count = static_cast<int>(to.spreads_end - to.spreads_begin);
  double* U = rest(child, lane);
  const int split = std::clamp(to.panel_rows, first, last);
  if (first < split) {
    kernels.gather(spreads, count, first, split, 0, U, to.update_stride(), to.columns % 8, panel(s),
                   node.stride);
  }
  if (split < last) {
    // Z_RR as if it were a part of the whole front.
    const std::int64_t stride = node.update_stride();
    const double* front = rest(s, lane) - node.columns * stride - node.columns / 8 * 8;
    kernels.gather(spreads, count, split, last, to.panel_rows, U, to.update_stride(),
                   to.columns % 8, front, stride);
  }
}

/// The rows of columns [first, last) of a child's Z_RR that `hand_down` could not find.
void SelectedInverse::mirror(std::int32_t child, std::int64_t lane, int first, int last) {
  const Supernode& to = nodes()[child];
  if (first >= last) return;
  cholesky_->kernels_->mirror(rest(child, lane), to.update_stride(), to.columns % 8, to.panel_rows,
                              first, last);
}

void SelectedInverse::diagonal_blocks(std::span<double> out) const {
  const auto order = cholesky_->symbolic_.order();
  const auto offsets = cholesky_->symbolic_.offsets();
  const auto sizes = cholesky_->structure_->sizes();
  std::vector<std::int64_t> begin(order.size() + 1, 0);
  for (std::size_t k = 0; k < order.size(); ++k)
    begin[k + 1] = begin[k] + std::int64_t{sizes[k]} * sizes[k];
  if (std::ssize(out) != begin.back())
    throw std::logic_error("diagonal_blocks: out does not have the size of all diagonal blocks");
  for (std::size_t p = 0; p < order.size(); ++p) {
    const Supernode& node = nodes()[supernode_of_[p]];
    const std::int64_t at = offsets[p] - offsets[node.block_begin];
    const double* from = panels_.data() + node.panel + at * node.stride + at;
    double* to = out.data() + begin[order[p]];
    const std::int32_t size = sizes[order[p]];
    for (std::int32_t c = 0; c < size; ++c) {
      for (std::int32_t r = 0; r < size; ++r) to[c * size + r] = from[c * node.stride + r];
    }
  }
}

bool SelectedInverse::block(std::int32_t i, std::int32_t j, double* out) const {
  const Symbolic& symbolic = cholesky_->symbolic_;
  const auto offsets = symbolic.offsets();
  const std::int32_t pi = symbolic.position()[i], pj = symbolic.position()[j];
  const std::int32_t column = std::min(pi, pj), row = std::max(pi, pj);
  const Supernode& node = nodes()[supernode_of_[column]];
  std::int64_t place = offsets[row] - offsets[node.block_begin];  // in the front
  if (row >= node.block_end) {
    const auto rows = symbolic.rows().subspan(node.rows_begin, node.rows_end - node.rows_begin);
    const auto found = std::ranges::lower_bound(rows, row);
    if (found == rows.end() || *found != row) return false;
    place = node.columns;
    for (auto r = rows.begin(); r != found; ++r) place += offsets[*r + 1] - offsets[*r];
  }
  const double* from = panels_.data() + node.panel +
                       (offsets[column] - offsets[node.block_begin]) * node.stride + place;
  // As stored: rows of the later block, columns of the earlier one.
  const std::int64_t rows = offsets[row + 1] - offsets[row];
  const std::int64_t columns = offsets[column + 1] - offsets[column];
  for (std::int64_t c = 0; c < columns; ++c) {
    for (std::int64_t r = 0; r < rows; ++r)
      out[pi >= pj ? c * rows + r : r * columns + c] = from[c * node.stride + r];
  }
  return true;
}

}  // namespace cairn::block
