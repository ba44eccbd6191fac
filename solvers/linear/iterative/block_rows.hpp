// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/runtime/aligned.hpp"

namespace cairn::iterative {

/// A symmetric block matrix by whole block rows, both triangles, so that every row of H x is summed
/// by one task in the order of its columns: bit by bit the same for any number of threads, and with
/// one stream of values. Takes twice the memory of the lower triangle.
class BlockRows {
 public:
  /// All that depends on the structure, which must outlive this object.
  void analyze(const BlockStructure& structure);
  /// Copies the values of H, on that structure.
  void load(const BlockMatrix& H);
  const BlockStructure& structure() const { return *structure_; }
  /// Multiplications in one product with a vector.
  std::int64_t values() const { return static_cast<std::int64_t>(values_.size()); }

  /// y = H x, in parallel.
  void multiply(std::span<const double> x, std::span<double> y) const;
  /// As `multiply`; returns xᵀ y.
  double multiply_dot(std::span<const double> x, std::span<double> y) const;
  /// y -= Σ_{j≠i} H_ij x_j for one block row i, y being of its size: a step of relaxation.
  void subtract_neighbours(int i, const double* x, double* y) const;

 private:
  struct Entry {
    std::int32_t column;  // block
    std::int32_t size;    // scalar columns
    std::int64_t x;       // first scalar of the column
    std::int64_t source;  // values in H
    std::int64_t value;   // values here
    bool transposed;
  };
  double multiply_rows(std::int32_t begin, std::int32_t end, const double* x, double* y) const;

  const BlockStructure* structure_ = nullptr;
  std::vector<std::int64_t> row_begin_;
  std::vector<Entry> entries_;
  std::vector<std::int32_t> chunk_begin_;  // of the block rows that one task takes, and their end
  AlignedVector values_;
  mutable std::vector<double> partial_;  // by chunk
};

}  // namespace cairn::iterative
