// SPDX-License-Identifier: BSD-3-Clause
#include "iterative/block_rows.hpp"

#include <algorithm>
#include <numeric>

#include "cairn/runtime/threads.hpp"
#include "iterative/small_blocks.hpp"

namespace cairn::iterative {
namespace {

/// Values that one task multiplies with at least: some ten microseconds.
constexpr std::int64_t kChunkValues = 32768;

}  // namespace

void BlockRows::analyze(const BlockStructure& structure) {
  structure_ = &structure;
  const int n = structure.blocks();
  row_begin_.assign(static_cast<std::size_t>(n) + 1, 0);
  for (int j = 0; j < n; ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
      const std::int32_t i = structure.rows()[e];
      ++row_begin_[i + 1];
      if (i != j) ++row_begin_[j + 1];
    }
  }
  std::partial_sum(row_begin_.begin(), row_begin_.end(), row_begin_.begin());

  entries_.resize(static_cast<std::size_t>(row_begin_.back()));
  std::vector<std::int64_t> next(row_begin_.begin(), row_begin_.end() - 1);
  const auto add = [&](std::int32_t row, std::int32_t column, std::int64_t e, bool transposed) {
    entries_[next[row]++] = {.column = column,
                             .size = structure.block_size(column),
                             .x = structure.offsets()[column],
                             .source = structure.value_begin()[e],
                             .value = 0,
                             .transposed = transposed};
  };
  // Columns left of the diagonal come first in every row, in rising order, then the others.
  for (int j = 0; j < n; ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e)
      add(structure.rows()[e], j, e, false);
  }
  for (int j = 0; j < n; ++j) {
    for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1]; ++e)
      add(j, structure.rows()[e], e, true);
  }

  chunk_begin_.assign(1, 0);
  std::int64_t total = 0, chunk_value = 0;
  for (int i = 0; i < n; ++i) {
    for (std::int64_t k = row_begin_[i]; k < row_begin_[i + 1]; ++k) {
      entries_[k].value = total;
      total += static_cast<std::int64_t>(structure.block_size(i)) * entries_[k].size;
    }
    if (total - chunk_value < kChunkValues && i + 1 < n) continue;
    chunk_begin_.push_back(i + 1);
    chunk_value = total;
  }
  values_.assign(static_cast<std::size_t>(total), 0.0);
  partial_.assign(chunk_begin_.size() - 1, 0.0);
}

void BlockRows::load(const BlockMatrix& H) {
  const double* source = H.values().data();
  for_each_chunk(chunk_begin_.size() - 1, [&](std::size_t c) {
    for (std::int32_t i = chunk_begin_[c]; i < chunk_begin_[c + 1]; ++i) {
      const int rows = structure_->block_size(i);
      for (std::int64_t k = row_begin_[i]; k < row_begin_[i + 1]; ++k) {
        const Entry& entry = entries_[k];
        const double* from = source + entry.source;
        double* to = values_.data() + entry.value;
        if (!entry.transposed) {
          std::copy_n(from, rows * entry.size, to);
          continue;
        }
        for (int column = 0; column < entry.size; ++column) {
          for (int row = 0; row < rows; ++row) *to++ = from[row * entry.size + column];
        }
      }
    }
  });
}

double BlockRows::multiply_rows(std::int32_t begin, std::int32_t end, const double* x,
                                double* y) const {
  double sum = 0.0;
  for (std::int32_t i = begin; i < end; ++i) {
    const int rows = structure_->block_size(i);
    const std::int64_t first = structure_->offsets()[i];
    sum += with_rows(rows, [&]<int kRows>() {
      constexpr int kRoom = kRows > 0 ? kRows : 1;
      double room[kRoom] = {};
      double* out = kRows > 0 ? room : y + first;
      if (kRows == 0) std::fill_n(out, rows, 0.0);
      for (std::int64_t k = row_begin_[i]; k < row_begin_[i + 1]; ++k) {
        const Entry& entry = entries_[k];
        add_block_product<kRows>(values_.data() + entry.value, rows, entry.size, x + entry.x, out);
      }
      if (kRows > 0) std::copy_n(room, kRoom, y + first);
      double product = 0.0;
      for (int r = 0; r < rows; ++r) product += x[first + r] * y[first + r];
      return product;
    });
  }
  return sum;
}

void BlockRows::multiply(std::span<const double> x, std::span<double> y) const {
  multiply_dot(x, y);
}

double BlockRows::multiply_dot(std::span<const double> x, std::span<double> y) const {
  for_each_chunk(partial_.size(), [&](std::size_t c) {
    partial_[c] = multiply_rows(chunk_begin_[c], chunk_begin_[c + 1], x.data(), y.data());
  });
  return std::accumulate(partial_.begin(), partial_.end(), 0.0);
}

void BlockRows::subtract_neighbours(int i, const double* x, double* y) const {
  const int rows = structure_->block_size(i);
  with_rows(rows, [&]<int kRows>() {
    for (std::int64_t k = row_begin_[i]; k < row_begin_[i + 1]; ++k) {
      const Entry& entry = entries_[k];
      if (entry.column == i) continue;
      add_block_product<kRows, true>(values_.data() + entry.value, rows, entry.size, x + entry.x,
                                     y);
    }
  });
}

}  // namespace cairn::iterative
