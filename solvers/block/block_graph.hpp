// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "cairn/linear/block_matrix.hpp"

namespace cairn::block {

/// The neighbours of each block, in both directions, without the diagonal.
struct BlockGraph {
  std::vector<std::int64_t> begin;
  std::vector<std::int32_t> neighbours;

  explicit BlockGraph(const BlockStructure& structure) : begin(structure.blocks() + 1, 0) {
    const auto for_each_edge = [&](auto visit) {
      for (std::int32_t j = 0; j < structure.blocks(); ++j) {
        for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
             ++e) {
          visit(structure.rows()[e], j);
        }
      }
    };
    for_each_edge([&](std::int32_t a, std::int32_t b) {
      ++begin[a + 1];
      ++begin[b + 1];
    });
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    neighbours.resize(begin.back());
    std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
    for_each_edge([&](std::int32_t a, std::int32_t b) {
      neighbours[next[a]++] = b;
      neighbours[next[b]++] = a;
    });
  }
  std::span<const std::int32_t> of(std::int32_t block) const {
    return std::span(neighbours).subspan(begin[block], begin[block + 1] - begin[block]);
  }
};

}  // namespace cairn::block
