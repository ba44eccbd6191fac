// SPDX-License-Identifier: BSD-3-Clause
#include "pcg/normal_blocks.hpp"

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

/// C += Aᵀ B with A inner × rows, B inner × columns, all column-major.
void add_product(const double* A, const double* B, int inner, int rows, int columns, double* C) {
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < rows; ++i) {
      double sum = 0.0;
      for (int k = 0; k < inner; ++k) sum += A[i * inner + k] * B[j * inner + k];
      C[j * rows + i] += sum;
    }
  }
}

}  // namespace

void NormalBlocks::analyze(const JacobianStructure& structure) {
  rows_ = &structure;
  J_ = nullptr;
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  products_.clear();
  product_begin_.assign(1, 0);
  for (int row = 0; row < structure.block_rows(); ++row) {
    for (std::int64_t a = structure.row_begin()[row]; a < structure.row_begin()[row + 1]; ++a) {
      for (std::int64_t b = structure.row_begin()[row]; b < structure.row_begin()[row + 1]; ++b) {
        const std::int32_t i = structure.columns()[a], j = structure.columns()[b];
        if (i < j) continue;
        products_.push_back({.a = a, .b = b, .target = -1});
        if (i > j) pairs.emplace_back(i, j);
      }
    }
    product_begin_.push_back(static_cast<std::int64_t>(products_.size()));
  }
  const std::span<const std::int32_t> sizes = structure.column_sizes();
  structure_ = BlockStructure({sizes.begin(), sizes.end()}, std::move(pairs));
  for (Product& product : products_) {
    product.target =
        structure_.find(structure.columns()[product.a], structure.columns()[product.b]);
  }
}

void NormalBlocks::load(const JacobianMatrix& J, std::span<const double> damping) {
  J_ = &J;
  damping_.assign(damping.begin(), damping.end());
}

template <class Keep>
void NormalBlocks::assemble_if(Keep keep, BlockMatrix& H) const {
  H.set_zero();
  for (int row = 0; row < rows_->block_rows(); ++row) {
    const auto first = products_.begin() + product_begin_[row];
    const auto last = products_.begin() + product_begin_[row + 1];
    if (!std::all_of(first, last, [&](const Product& p) { return keep(p); })) continue;
    for (auto p = first; p != last; ++p) {
      add_product(J_->block(p->a), J_->block(p->b), rows_->row_sizes()[row],
                  rows_->column_sizes()[rows_->columns()[p->a]],
                  rows_->column_sizes()[rows_->columns()[p->b]], H.block(p->target));
    }
  }
  if (damping_.empty()) return;
  for (int j = 0; j < structure_.blocks(); ++j) {
    const std::int32_t n = structure_.block_size(j);
    double* block = H.block(structure_.column_begin()[j]);
    for (std::int32_t k = 0; k < n; ++k) block[k * n + k] += damping_[structure_.offsets()[j] + k];
  }
}

void NormalBlocks::assemble(BlockMatrix& H) const {
  assemble_if([](const Product&) { return true; }, H);
}

void NormalBlocks::assemble_part(std::span<const std::uint8_t> marked, BlockMatrix& H) const {
  assemble_if(
      [&](const Product& p) {
        return rows_->columns()[p.a] == rows_->columns()[p.b] || marked[p.target];
      },
      H);
}

}  // namespace cairn
