// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/block_matrix.hpp"

#include <algorithm>
#include <atomic>
#include <limits>
#include <type_traits>

#include "cairn/runtime/error.hpp"

namespace cairn {

BlockStructure::BlockStructure(std::vector<std::int32_t> sizes,
                               std::vector<std::pair<std::int32_t, std::int32_t>> entries)
    : sizes_(std::move(sizes)) {
  static std::atomic<std::uint64_t> counter{0};  // only a source of distinct numbers
  version_ = ++counter;

  const std::int32_t n = static_cast<std::int32_t>(sizes_.size());
  offsets_.assign(n + 1, 0);
  for (std::int32_t j = 0; j < n; ++j) offsets_[j + 1] = offsets_[j] + sizes_[j];

  // Bucket by column (counting sort), then sort the rows of each column and drop repeats.
  std::vector<std::int64_t> begin(n + 1, 0);
  for (auto& [row, column] : entries) {
    if (row < column) std::swap(row, column);
    if (row != column) ++begin[column + 1];
  }
  for (std::int32_t j = 0; j < n; ++j) begin[j + 1] += begin[j];
  std::vector<std::int32_t> bucket(begin[n]);
  std::vector<std::int64_t> next(begin.begin(), begin.end());
  for (const auto& [row, column] : entries) {
    if (row != column) bucket[next[column]++] = row;
  }
  column_begin_.assign(n + 1, 0);
  rows_.reserve(bucket.size() + n);
  for (std::int32_t j = 0; j < n; ++j) {
    rows_.push_back(j);
    const auto first = bucket.begin() + begin[j], last = bucket.begin() + begin[j + 1];
    std::sort(first, last);
    rows_.insert(rows_.end(), first, std::unique(first, last));
    column_begin_[j + 1] = static_cast<std::int64_t>(rows_.size());
  }
  value_begin_.reserve(rows_.size() + 1);
  std::int64_t total = 0;
  for (std::int32_t j = 0; j < n; ++j) {
    for (std::int64_t e = column_begin_[j]; e < column_begin_[j + 1]; ++e) {
      value_begin_.push_back(total);
      total += static_cast<std::int64_t>(sizes_[rows_[e]]) * sizes_[j];
    }
  }
  value_begin_.push_back(total);
}

std::int64_t BlockStructure::find(std::int32_t row, std::int32_t column) const {
  const auto first = rows_.begin() + column_begin_[column],
             last = rows_.begin() + column_begin_[column + 1];
  const auto it = std::lower_bound(first, last, row);
  return it != last && *it == row ? it - rows_.begin() : -1;
}

BlockMatrix::BlockMatrix(const BlockStructure& structure)
    : structure_(&structure), values_(static_cast<std::size_t>(structure.values()), 0.0) {}

void BlockMatrix::set_zero() { std::fill(values_.begin(), values_.end(), 0.0); }

void BlockMatrix::diagonal(std::span<double> out) const {
  double* target = out.data();
  const auto take = [&](const double* values, auto size) {
    for (int k = 0; k < size; ++k) *target++ = values[k * size + k];
  };
  for (int j = 0; j < structure_->blocks(); ++j) {
    const double* values = block(structure_->column_begin()[j]);
    const std::int32_t size = structure_->block_size(j);
    size == 3 ? take(values, std::integral_constant<int, 3>()) : take(values, size);
  }
}

void BlockMatrix::set_diagonal(std::span<const double> diagonal) {
  for (int j = 0; j < structure_->blocks(); ++j) {
    const std::int32_t size = structure_->block_size(j);
    double* values = block(structure_->column_begin()[j]);
    const double* source = diagonal.data() + structure_->offsets()[j];
    for (std::int32_t k = 0; k < size; ++k) values[k * size + k] = source[k];
  }
}

namespace {

/// y_i += B x_j, and y_j += Bᵀ x_i unless B is on the diagonal. Loops of constant size are
/// unrolled.
template <class Size>
void add_products(const double* __restrict B, Size rows, Size columns, bool diagonal,
                  const double* __restrict x_i, const double* __restrict x_j, double* y_i,
                  double* y_j) {
  for (int c = 0; c < columns; ++c) {
    for (int r = 0; r < rows; ++r) y_i[r] += B[c * rows + r] * x_j[c];
  }
  if (diagonal) return;
  for (int c = 0; c < columns; ++c) {
    for (int r = 0; r < rows; ++r) y_j[c] += B[c * rows + r] * x_i[r];
  }
}

}  // namespace

void BlockMatrix::multiply(std::span<const double> x, std::span<double> y) const {
  const BlockStructure& s = *structure_;
  std::fill(y.begin(), y.end(), 0.0);
  for (int j = 0; j < s.blocks(); ++j) {
    for (std::int64_t e = s.column_begin()[j]; e < s.column_begin()[j + 1]; ++e) {
      const std::int32_t i = s.rows()[e];
      const std::int64_t at_i = s.offsets()[i], at_j = s.offsets()[j];
      const auto add = [&](auto rows, auto columns) {
        add_products(block(e), rows, columns, i == j, &x[at_i], &x[at_j], &y[at_i], &y[at_j]);
      };
      const int rows = s.block_size(i), columns = s.block_size(j);
      if (rows == 3 && columns == 3) {
        add(std::integral_constant<int, 3>(), std::integral_constant<int, 3>());
      } else if (rows == 6 && columns == 6) {
        add(std::integral_constant<int, 6>(), std::integral_constant<int, 6>());
      } else {
        add(rows, columns);
      }
    }
  }
}

namespace {

/// Calls visit(row, column, place in the values) for every scalar of the lower triangle, column by
/// column.
template <class Visit>
void for_each_scalar(const BlockStructure& s, Visit visit) {
  for (int j = 0; j < s.blocks(); ++j) {
    for (std::int32_t c = 0; c < s.block_size(j); ++c) {
      for (std::int64_t e = s.column_begin()[j]; e < s.column_begin()[j + 1]; ++e) {
        const std::int32_t i = s.rows()[e], rows = s.block_size(i);
        for (std::int32_t r = i == j ? c : 0; r < rows; ++r) {
          visit(static_cast<int>(s.offsets()[i] + r), static_cast<int>(s.offsets()[j] + c),
                s.value_begin()[e] + static_cast<std::int64_t>(c) * rows + r);
        }
      }
    }
  }
}

}  // namespace

ScalarPattern::ScalarPattern(const BlockStructure& structure, Triangle triangle) {
  const std::int64_t n = structure.size();
  std::int64_t nonzeros = 0;
  for_each_scalar(structure, [&](int, int, std::int64_t) { ++nonzeros; });
  if (n >= std::numeric_limits<int>::max() || nonzeros > std::numeric_limits<int>::max()) {
    throw Error(ErrorCode::usage,
                "the matrix has more scalars than a solver with 32-bit indices can take; use "
                "block_cholesky");
  }
  const bool lower = triangle == Triangle::lower;
  column_begin_.assign(n + 1, 0);
  for_each_scalar(structure, [&](int row, int column, std::int64_t) {
    ++column_begin_[(lower ? column : row) + 1];
  });
  for (std::int64_t k = 0; k < n; ++k) column_begin_[k + 1] += column_begin_[k];
  rows_.resize(nonzeros);
  source_.resize(nonzeros);
  std::vector<int> next(column_begin_.begin(), column_begin_.end() - 1);
  for_each_scalar(structure, [&](int row, int column, std::int64_t source) {
    const int place = next[lower ? column : row]++;
    rows_[place] = lower ? row : column;
    source_[place] = source;
  });
}

void ScalarPattern::scatter(const BlockMatrix& matrix, std::span<double> values) const {
  const double* source = matrix.values().data();
  for (std::size_t k = 0; k < source_.size(); ++k) values[k] = source[source_[k]];
}

}  // namespace cairn
