// SPDX-License-Identifier: BSD-3-Clause
#include "block/supernodal_cholesky.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>

#include "block/ordering.hpp"
#include "cairn/error.hpp"
#include "cairn/threads.hpp"

namespace cairn::block {
namespace {

/// A front with more entries than this is cut into tiles, for several threads.
constexpr std::int64_t kLargeFront = 256 * 256;
/// Rows of one such tile, and columns of its panel that are factored before the rows below them.
constexpr int kTileRows = 96;
constexpr int kTileColumns = 48;
/// Columns of a child that one task adds to a large front.
constexpr int kTileAdded = 24;

bool is_large(const Supernode& node) { return std::int64_t{node.m} * node.m > kLargeFront; }

/// body(0) … body(chunks - 1), in parallel if asked for. `std::ref`: nothing is allocated.
template <class Body>
void for_each(bool parallel, int chunks, const Body& body) {
  if (parallel) {
    for_each_chunk(static_cast<std::size_t>(chunks), std::ref(body));
  } else {
    for (int chunk = 0; chunk < chunks; ++chunk) body(static_cast<std::size_t>(chunk));
  }
}

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
    // As `choose` does, without counting flops twice.
    ordering_ = "amd";
    symbolic_ = Symbolic(structure, order(structure, ordering_), cost);
    if (const auto better = better_than(structure, symbolic_.factor_flops)) {
      ordering_ = better->name;
      symbolic_ = Symbolic(structure, better->order, cost);
    }
  } else {
    symbolic_ = Symbolic(structure, order(structure, ordering), cost);
    ordering_ = ordering;
  }
  structure_ = &structure;
  version_ = structure.version();
  schedule_ = Schedule(symbolic_, threads());
  panels_ = AlignedVector(symbolic_.panel_values());
  workspace_ = AlignedVector(schedule_.size);
  failed_.assign(symbolic_.supernodes().size(), -1);
  plan_solve();
}

Factorization SupernodalCholesky::factorize(const BlockMatrix& H) {
  if (!structure_ || H.structure().version() != version_) {
    throw std::logic_error("factorize: analyze this structure first");
  }
  const std::int32_t count = static_cast<std::int32_t>(failed_.size());
  if (schedule_.lanes == 1) {
    for (std::int32_t s = 0; s < count; ++s) factorize_supernode(H, s, 0, false);
  } else {
    std::atomic<std::size_t> next{0};
    for_each(true, schedule_.lanes, [&](std::size_t lane) {
      for (std::size_t t = next++; t < schedule_.tasks.size(); t = next++) {
        const Schedule::Task& task = schedule_.tasks[t];
        for (std::int32_t s = task.begin; s < task.end; ++s)
          factorize_supernode(H, s, static_cast<std::int64_t>(lane), false);
      }
    });
    for (const std::vector<std::int32_t>& level : schedule_.levels) {
      const bool across = level.size() >= static_cast<std::size_t>(schedule_.lanes);
      for_each(across, static_cast<int>(level.size()),
               [&](std::size_t k) { factorize_supernode(H, level[k], 0, !across); });
    }
  }

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

void SupernodalCholesky::factorize_supernode(const BlockMatrix& H, std::int32_t s,
                                             std::int64_t lane, bool parallel) {
  const auto nodes = symbolic_.supernodes();
  const Supernode& node = nodes[s];
  const auto children = symbolic_.children(s);
  const auto entries = symbolic_.assembly(s);
  double* panel = panels_.data() + node.panel;

  kernels_->assemble(entries.data(), static_cast<int>(entries.size()), H.values().data(),
                     panels_.data(), panel, std::int64_t{node.stride} * node.columns);
  for (const std::int32_t c : children)
    add_child(c, update_matrix(c, lane), 0, nodes[c].panel_rows, panel, node.stride, parallel);
  factor_panel(node, s, parallel);
  if (node.m == node.columns) return;

  double* U = update_matrix(s, lane);
  update(node, U, parallel);
  // U as if it were a part of the whole front.
  const std::int64_t stride = node.update_stride();
  double* front = U - node.columns * stride - node.columns / 8 * 8;
  for (const std::int32_t c : children) {
    add_child(c, update_matrix(c, lane), nodes[c].panel_rows, nodes[c].m - nodes[c].columns, front,
              stride, parallel);
  }
}

/// Adds columns [first, last) of a child's update matrix to the panel or, beyond it, to the update
/// matrix.
void SupernodalCholesky::add_child(std::int32_t c, const double* child, int first, int last,
                                   double* front, std::int64_t stride, bool parallel) {
  const Supernode& node = symbolic_.supernodes()[c];
  const Spread* spreads = symbolic_.spreads().data() + node.spreads_begin;
  const int count = static_cast<int>(node.spreads_end - node.spreads_begin);
  const auto add = [&](int begin, int end) {
    kernels_->extend_add(spreads, count, begin, end, child + node.columns % 8, node.update_stride(),
                         front, stride);
  };
  if (!parallel || !is_large(node)) return add(first, last);
  for_each(true, (last - first + kTileAdded - 1) / kTileAdded, [&](std::size_t tile) {
    const int begin = first + static_cast<int>(tile) * kTileAdded;
    add(begin, std::min(last, begin + kTileAdded));
  });
}

void SupernodalCholesky::factor_panel(const Supernode& node, std::int32_t s, bool parallel) {
  double* panel = panels_.data() + node.panel;
  if (!is_large(node)) {
    failed_[s] = kernels_->factor_panel(panel, node.stride, 0, node.columns, node.stride);
    return;
  }
  failed_[s] = -1;
  for (int first = 0; first < node.columns; first += kTileColumns) {
    const int last = std::min(node.columns, first + kTileColumns);
    const int below = std::min(node.stride, (last + 7) / 8 * 8);
    const int failed = kernels_->factor_panel(panel, node.stride, first, last, below);
    if (failed_[s] < 0) failed_[s] = failed;
    for_each(parallel, (node.stride - below + kTileRows - 1) / kTileRows, [&](std::size_t tile) {
      const int row = below + static_cast<int>(tile) * kTileRows;
      kernels_->factor_rows(panel, node.stride, first, last, row,
                            std::min(node.stride, row + kTileRows));
    });
  }
}

void SupernodalCholesky::update(const Supernode& node, double* U, bool parallel) {
  const double* panel = panels_.data() + node.panel;
  const int begin = node.columns / 8 * 8;
  if (!is_large(node)) {
    kernels_->update(panel, node.stride, node.columns, node.m, U, begin, node.stride);
    return;
  }
  const int tiles = (node.stride - begin + kTileRows - 1) / kTileRows;
  for_each(parallel, tiles, [&](std::size_t tile) {
    // The last tiles have the longest rows: hand them out first.
    const int first = begin + (tiles - 1 - static_cast<int>(tile)) * kTileRows;
    kernels_->update(panel, node.stride, node.columns, node.m, U, first,
                     std::min(node.stride, first + kTileRows));
  });
}

}  // namespace cairn::block
