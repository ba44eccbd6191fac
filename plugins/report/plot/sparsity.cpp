// SPDX-License-Identifier: BSD-3-Clause
#include "sparsity.hpp"

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/packed_array.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::plot {
namespace {

/// More cells than that on a side are finer than the eye, and make large files.
constexpr int kMostCells = 400;

/// Where a matrix has blocks, on a grid of cells of several blocks each.
class Grid {
 public:
  explicit Grid(int blocks)
      : blocks_(blocks),
        cells_(std::min(blocks, kMostCells)),
        marked_(std::size_t(cells_) * std::size_t(cells_)) {}
  int cells() const { return cells_; }
  void mark(std::int32_t row, std::int32_t column) {
    marked_[std::size_t(cell(row)) * std::size_t(cells_) + std::size_t(cell(column))] = 1;
  }
  const std::vector<std::uint8_t>& marked() const { return marked_; }

 private:
  int cell(std::int32_t block) const {
    return static_cast<int>(std::int64_t{block} * cells_ / blocks_);
  }
  int blocks_, cells_;
  std::vector<std::uint8_t> marked_;
};

/// The blocks of variables that are not held, as the linearizer numbers them.
BlockStructure structure_of(const Scene& scene) {
  std::vector<std::int32_t> block(scene.ids.size(), -1), sizes;
  for (std::size_t v = 0; v < scene.ids.size(); ++v) {
    if (v < scene.held.size() && scene.held[v]) continue;
    block[v] = static_cast<std::int32_t>(sizes.size());
    sizes.push_back(scene.variable_types[scene.variable_type[v]].tangent_size);
  }
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  const auto join = [&](std::int32_t a, std::int32_t b) {
    if (a < 0 || b < 0 || block[std::size_t(a)] < 0 || block[std::size_t(b)] < 0) return;
    if (a != b) entries.emplace_back(block[std::size_t(a)], block[std::size_t(b)]);
  };
  for (std::size_t e = 0; e < scene.a.size(); ++e) {
    join(scene.a[e], scene.b[e]);
    // A factor on several variables joins each with each; its edges follow each other.
    for (std::size_t f = e;
         f-- > 0 && !scene.factor.empty() && scene.factor[f] == scene.factor[e];) {
      join(scene.b[f], scene.b[e]);
    }
  }
  return {std::move(sizes), std::move(entries)};
}

struct Pattern {
  Grid grid;
  std::int64_t blocks = 0;    ///< in the lower triangle, diagonal included
  std::int64_t nonzeros = 0;  ///< scalars of them
};

std::int64_t scalars(const BlockStructure& H, std::int32_t row, std::int32_t column) {
  const std::int64_t n = H.block_size(row), m = H.block_size(column);
  return row == column ? n * (n + 1) / 2 : n * m;
}

Pattern pattern_of_H(const BlockStructure& H) {
  Pattern pattern{Grid(H.blocks())};
  for (std::int32_t column = 0; column < H.blocks(); ++column) {
    for (auto k = H.column_begin()[column]; k < H.column_begin()[column + 1]; ++k) {
      const std::int32_t row = H.rows()[k];
      pattern.grid.mark(row, column);
      pattern.grid.mark(column, row);
      ++pattern.blocks;
      pattern.nonzeros += scalars(H, row, column);
    }
  }
  return pattern;
}

/// Row by row: L has a block at (i, j) for every j on the way in the elimination tree from a block
/// of H in row i up to i (Gilbert, Ng and Peyton 1994).
Pattern pattern_of_L(const BlockStructure& H, std::span<const std::int32_t> order) {
  const auto n = static_cast<std::size_t>(H.blocks());
  std::vector<std::int32_t> position(n);
  for (std::size_t k = 0; k < n; ++k) position[std::size_t(order[k])] = std::int32_t(k);
  std::vector<std::vector<std::int32_t>> left(n);  // blocks of H left of the diagonal, by row
  for (std::int32_t column = 0; column < H.blocks(); ++column) {
    for (auto k = H.column_begin()[column]; k < H.column_begin()[column + 1]; ++k) {
      const auto [low, high] =
          std::minmax(position[std::size_t(H.rows()[k])], position[std::size_t(column)]);
      if (low != high) left[std::size_t(high)].push_back(low);
    }
  }
  Pattern pattern{Grid(H.blocks())};
  std::vector<std::int32_t> parent(n, -1), seen(n, -1);
  const auto add = [&](std::int32_t row, std::int32_t column) {
    pattern.grid.mark(row, column);
    ++pattern.blocks;
    pattern.nonzeros += scalars(H, order[std::size_t(row)], order[std::size_t(column)]);
  };
  for (std::int32_t i = 0; i < H.blocks(); ++i) {
    add(i, i);
    seen[std::size_t(i)] = i;
    for (std::int32_t j : left[std::size_t(i)]) {
      while (seen[std::size_t(j)] != i) {
        seen[std::size_t(j)] = i;
        add(i, j);
        if (parent[std::size_t(j)] < 0) parent[std::size_t(j)] = i;
        j = parent[std::size_t(j)];
      }
    }
  }
  return pattern;
}

std::string pattern_json(const Pattern& pattern) {
  return fmt::format(
      R"({{"cells":{},"marked":{},"blocks":{},"nonzeros":{}}})", pattern.grid.cells(),
      packed_json(std::span<const std::uint8_t>(pattern.grid.marked()), Packing::deflate),
      pattern.blocks, pattern.nonzeros);
}

}  // namespace

std::string sparsity_json(const Album& album, LinearSolver& solver) {
  auto* order = query<EliminationOrder>(solver);
  if (!order) {
    throw Error(
        ErrorCode::usage,
        "this linear solver does not say in which order it eliminates; block_cholesky does");
  }
  const auto scene = std::find_if(album.scenes.begin(), album.scenes.end(),
                                  [](const Scene& s) { return s.factors > 0; });
  if (scene == album.scenes.end()) {
    throw Error(ErrorCode::input, "no graph with factors whose matrix could be drawn");
  }
  const BlockStructure H = structure_of(*scene);
  if (H.blocks() == 0) throw Error(ErrorCode::input, scene->name + ": all variables are constant");
  solver.analyze(H);
  return fmt::format(R"({{"name":{},"ordering":{},"H":{},"L":{}}})", json_string(scene->name),
                     json_string(solver.stats().ordering), pattern_json(pattern_of_H(H)),
                     pattern_json(pattern_of_L(H, order->elimination_order())));
}

}  // namespace cairn::plot
