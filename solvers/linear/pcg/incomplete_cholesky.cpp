// SPDX-License-Identifier: BSD-3-Clause
#include "pcg/incomplete_cholesky.hpp"

#include <algorithm>

#include <fmt/core.h>

#include "iterative/small_blocks.hpp"
#include "iterative/vectors.hpp"

namespace cairn {
namespace {

constexpr double kFirstShift = 1e-3;
constexpr double kLargestShift = 1e6;

/// X = X L⁻ᵀ for X rows × n, column-major; L as `factorize_block` leaves it.
void divide_right(double* X, int rows, const double* L, int n) {
  for (int j = 0; j < n; ++j) {
    double* column = X + static_cast<std::ptrdiff_t>(j) * rows;
    for (int k = 0; k < j; ++k) {
      const double factor = L[static_cast<std::ptrdiff_t>(k) * n + j];
      const double* left = X + static_cast<std::ptrdiff_t>(k) * rows;
      for (int i = 0; i < rows; ++i) column[i] -= left[i] * factor;
    }
    const double reciprocal = L[static_cast<std::ptrdiff_t>(j) * n + j];
    for (int i = 0; i < rows; ++i) column[i] *= reciprocal;
  }
}

/// C -= A Bᵀ with A rows × inner, B columns × inner.
void subtract_product(double* C, const double* A, const double* B, int rows, int columns,
                      int inner) {
  for (int k = 0; k < inner; ++k) {
    for (int j = 0; j < columns; ++j) {
      const double factor = B[k * columns + j];
      for (int i = 0; i < rows; ++i) C[j * rows + i] -= A[k * rows + i] * factor;
    }
  }
}

}  // namespace

void IncompleteCholesky::analyze(const BlockStructure& structure) {
  structure_ = &structure;
  L_.assign(static_cast<std::size_t>(structure.values()), 0.0);
  place_.assign(static_cast<std::size_t>(structure.blocks()), -1);
  largest_shift_ = 0.0;
}

Factorization IncompleteCholesky::factorize(const BlockMatrix& H, const iterative::DiagonalBlocks&,
                                            const NormalBlocks*) {
  for (shift_ = 0.0; shift_ < kLargestShift; shift_ = std::max(10.0 * shift_, kFirstShift)) {
    if (!try_factorize(H)) continue;
    largest_shift_ = std::max(largest_shift_, shift_);
    return {};
  }
  return {false, -1};
}

bool IncompleteCholesky::try_factorize(const BlockMatrix& H) {
  const BlockStructure& s = *structure_;
  std::copy(H.values().begin(), H.values().end(), L_.begin());
  for (int j = 0; j < s.blocks(); ++j) {
    double* diagonal = L_.data() + s.value_begin()[s.column_begin()[j]];
    for (int k = 0; k < s.block_size(j) * s.block_size(j); ++k) diagonal[k] *= 1.0 + shift_;
  }
  for (int j = 0; j < s.blocks(); ++j) {
    if (!factorize_column(j)) return false;
    update_columns(j);
  }
  return true;
}

bool IncompleteCholesky::factorize_column(int j) {
  const BlockStructure& s = *structure_;
  const std::int64_t first = s.column_begin()[j];
  double* diagonal = L_.data() + s.value_begin()[first];
  if (!iterative::factorize_block(diagonal, s.block_size(j))) return false;
  for (std::int64_t e = first + 1; e < s.column_begin()[j + 1]; ++e) {
    divide_right(L_.data() + s.value_begin()[e], s.block_size(s.rows()[e]), diagonal,
                 s.block_size(j));
  }
  return true;
}

/// H_ik -= L_ij L_kjᵀ for all pairs i ≥ k of rows of column j, where H has a block.
void IncompleteCholesky::update_columns(int j) {
  const BlockStructure& s = *structure_;
  const std::int64_t last = s.column_begin()[j + 1];
  for (std::int64_t e = s.column_begin()[j] + 1; e < last; ++e) {
    const std::int32_t k = s.rows()[e];
    for (std::int64_t t = s.column_begin()[k]; t < s.column_begin()[k + 1]; ++t)
      place_[s.rows()[t]] = t;
    for (std::int64_t f = e; f < last; ++f) {
      const std::int32_t i = s.rows()[f];
      if (place_[i] < 0) continue;
      subtract_product(L_.data() + s.value_begin()[place_[i]], L_.data() + s.value_begin()[f],
                       L_.data() + s.value_begin()[e], s.block_size(i), s.block_size(k),
                       s.block_size(j));
    }
    for (std::int64_t t = s.column_begin()[k]; t < s.column_begin()[k + 1]; ++t)
      place_[s.rows()[t]] = -1;
  }
}

double IncompleteCholesky::apply(std::span<const double> r, std::span<double> z) {
  std::copy(r.begin(), r.end(), z.begin());
  forward(z.data());
  backward(z.data());
  return iterative::dot(r, z);
}

void IncompleteCholesky::forward(double* z) const {
  const BlockStructure& s = *structure_;
  for (int j = 0; j < s.blocks(); ++j) {
    const std::int64_t first = s.column_begin()[j];
    const int columns = s.block_size(j);
    double* x = z + s.offsets()[j];
    iterative::forward_block(L_.data() + s.value_begin()[first], columns, x);
    for (std::int64_t e = first + 1; e < s.column_begin()[j + 1]; ++e) {
      const std::int32_t i = s.rows()[e], rows = s.block_size(i);
      const double* block = L_.data() + s.value_begin()[e];
      double* y = z + s.offsets()[i];
      iterative::with_rows(rows, [&]<int kRows>() {
        iterative::add_block_product<kRows, true>(block, rows, columns, x, y);
      });
    }
  }
}

void IncompleteCholesky::backward(double* z) const {
  const BlockStructure& s = *structure_;
  for (int j = s.blocks() - 1; j >= 0; --j) {
    const std::int64_t first = s.column_begin()[j];
    const int columns = s.block_size(j);
    double* x = z + s.offsets()[j];
    for (std::int64_t e = first + 1; e < s.column_begin()[j + 1]; ++e) {
      const std::int32_t i = s.rows()[e], rows = s.block_size(i);
      const double* block = L_.data() + s.value_begin()[e];
      const double* y = z + s.offsets()[i];
      iterative::with_rows(rows, [&]<int kRows>() {
        iterative::subtract_transposed_product<kRows>(block, rows, columns, y, x);
      });
    }
    iterative::backward_block(L_.data() + s.value_begin()[first], columns, x);
  }
}

std::string IncompleteCholesky::note() const {
  std::string note = "incomplete block Cholesky preconditioner";
  if (largest_shift_ > 0.0)
    note += fmt::format(", broke down and was shifted by up to {:g}", largest_shift_);
  return note;
}

}  // namespace cairn
