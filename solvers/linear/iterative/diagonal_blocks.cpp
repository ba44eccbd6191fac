// SPDX-License-Identifier: BSD-3-Clause
#include "iterative/diagonal_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cairn/runtime/threads.hpp"
#include "iterative/small_blocks.hpp"

namespace cairn::iterative {
namespace {

/// Blocks that one task takes.
constexpr std::size_t kChunk = 1024;

/// inverse = L⁻ᵀ L⁻¹, n × n.
void invert(const double* L, int n, double* inverse) {
  std::fill_n(inverse, n * n, 0.0);
  for (int j = 0; j < n; ++j) {
    double* column = inverse + static_cast<std::ptrdiff_t>(j) * n;
    column[j] = 1.0;
    forward_block(L, n, column);
    backward_block(L, n, column);
  }
}

}  // namespace

bool factorize_block(double* A, int n) {
  for (int j = 0; j < n; ++j) {
    double* column = A + static_cast<std::ptrdiff_t>(j) * n;
    for (int k = 0; k < j; ++k) {
      const double* left = A + static_cast<std::ptrdiff_t>(k) * n;
      for (int i = j; i < n; ++i) column[i] -= left[i] * left[j];
    }
    if (!(column[j] > 0.0) || !std::isfinite(column[j])) return false;
    const double reciprocal = 1.0 / std::sqrt(column[j]);
    column[j] = reciprocal;
    for (int i = j + 1; i < n; ++i) column[i] *= reciprocal;
  }
  return true;
}

void forward_block(const double* L, int n, double* x) {
  for (int j = 0; j < n; ++j) {
    const double* column = L + static_cast<std::ptrdiff_t>(j) * n;
    x[j] *= column[j];
    for (int i = j + 1; i < n; ++i) x[i] -= column[i] * x[j];
  }
}

void backward_block(const double* L, int n, double* x) {
  for (int j = n - 1; j >= 0; --j) {
    const double* column = L + static_cast<std::ptrdiff_t>(j) * n;
    for (int i = j + 1; i < n; ++i) x[j] -= column[i] * x[i];
    x[j] *= column[j];
  }
}

void DiagonalBlocks::analyze(const BlockStructure& structure) {
  structure_ = &structure;
  begin_.assign(static_cast<std::size_t>(structure.blocks()) + 1, 0);
  for (int i = 0; i < structure.blocks(); ++i) {
    begin_[i + 1] =
        begin_[i] + static_cast<std::int64_t>(structure.block_size(i)) * structure.block_size(i);
  }
  values_.assign(static_cast<std::size_t>(begin_.back()), 0.0);
  inverses_ = values_;
  partial_.assign((static_cast<std::size_t>(structure.blocks()) + kChunk - 1) / kChunk, 0.0);
}

Factorization DiagonalBlocks::factorize(const BlockMatrix& H) {
  const BlockStructure& s = *structure_;
  for (int j = 0; j < s.blocks(); ++j) {
    const std::int64_t first = s.column_begin()[j], last = s.column_begin()[j + 1];
    const double* begin = H.values().data() + s.value_begin()[first];
    const double* end = H.values().data() + s.value_begin()[last];
    if (!std::all_of(begin, end, [](double v) { return std::isfinite(v); })) return {false, j};
    std::copy_n(H.block(first), begin_[j + 1] - begin_[j], values_.data() + begin_[j]);
    if (!factorize_block(values_.data() + begin_[j], s.block_size(j))) return {false, j};
    invert(block(j), s.block_size(j), inverses_.data() + begin_[j]);
  }
  return {};
}

double DiagonalBlocks::solve(std::span<const double> r, std::span<double> z) const {
  for_each_range(
      static_cast<std::size_t>(structure_->blocks()), kChunk,
      [&](std::size_t begin, std::size_t end) {
        double sum = 0.0;
        for (std::size_t i = begin; i < end; ++i) {
          const std::int64_t first = structure_->offsets()[i], last = structure_->offsets()[i + 1];
          std::fill(z.begin() + first, z.begin() + last, 0.0);
          const int n = static_cast<int>(last - first);
          add_product(inverse(static_cast<int>(i)), n, n, r.data() + first, z.data() + first);
          for (std::int64_t k = first; k < last; ++k) sum += r[k] * z[k];
        }
        partial_[begin / kChunk] = sum;
      });
  return std::accumulate(partial_.begin(), partial_.end(), 0.0);
}

}  // namespace cairn::iterative
