// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/runtime/aligned.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Where the blocks of a sparse symmetric block matrix are: the lower triangle by block columns.
/// Blocks of different sizes live in one matrix. Structure and values are separate: a symbolic
/// analysis of a structure is valid until `version` changes.
class CAIRN_API BlockStructure {
 public:
  BlockStructure() = default;
  /// `sizes`: rows of each diagonal block. `entries`: pairs (row, column) of off-diagonal blocks,
  /// in any order and on either side of the diagonal, repeats allowed; diagonal blocks are always
  /// there.
  BlockStructure(std::vector<std::int32_t> sizes,
                 std::vector<std::pair<std::int32_t, std::int32_t>> entries);

  int blocks() const { return static_cast<int>(sizes_.size()); }                ///< block rows
  std::int64_t size() const { return offsets_.empty() ? 0 : offsets_.back(); }  ///< scalar rows
  std::int32_t block_size(int block) const { return sizes_[block]; }
  /// First scalar row of a block; n+1 entries.
  std::span<const std::int64_t> offsets() const { return offsets_; }
  std::span<const std::int32_t> sizes() const { return sizes_; }

  /// Entries of block column j are column_begin()[j] … column_begin()[j+1]-1, the diagonal block
  /// first, then by rising row.
  std::span<const std::int64_t> column_begin() const { return column_begin_; }
  std::span<const std::int32_t> rows() const { return rows_; }
  /// Where an entry's values start (column-major, rows × columns); one more entry holds the total.
  std::span<const std::int64_t> value_begin() const { return value_begin_; }
  std::int64_t entries() const { return static_cast<std::int64_t>(rows_.size()); }
  std::int64_t values() const { return value_begin_.empty() ? 0 : value_begin_.back(); }
  /// The entry at (row, column), row ≥ column, or -1.
  std::int64_t find(std::int32_t row, std::int32_t column) const;

  /// Differs between any two structures made in this process.
  std::uint64_t version() const { return version_; }

 private:
  std::vector<std::int32_t> sizes_;
  std::vector<std::int64_t> offsets_;
  std::vector<std::int64_t> column_begin_;
  std::vector<std::int32_t> rows_;
  std::vector<std::int64_t> value_begin_;
  std::uint64_t version_ = 0;
};

/// Values on a BlockStructure, which must outlive it. Diagonal blocks are stored whole (both
/// triangles).
class CAIRN_API BlockMatrix {
 public:
  BlockMatrix() = default;
  explicit BlockMatrix(const BlockStructure& structure);

  const BlockStructure& structure() const { return *structure_; }
  std::span<double> values() { return values_; }
  std::span<const double> values() const { return values_; }
  double* block(std::int64_t entry) { return values_.data() + structure_->value_begin()[entry]; }
  const double* block(std::int64_t entry) const {
    return values_.data() + structure_->value_begin()[entry];
  }
  void set_zero();

  /// The scalar diagonal, size() doubles.
  void diagonal(std::span<double> out) const;
  /// Replaces the scalar diagonal.
  void set_diagonal(std::span<const double> diagonal);
  /// y = H x with the whole symmetric matrix.
  void multiply(std::span<const double> x, std::span<double> y) const;

 private:
  const BlockStructure* structure_ = nullptr;
  AlignedVector values_;
};

/// For adapters to scalar solvers: the pattern of one triangle in compressed columns, computed once
/// per structure, and a scatter of block values into it.
class CAIRN_API ScalarPattern {
 public:
  enum class Triangle { lower, upper };
  ScalarPattern() = default;
  ScalarPattern(const BlockStructure& structure, Triangle triangle);

  int size() const { return static_cast<int>(column_begin_.size()) - 1; }
  std::span<const int> column_begin() const { return column_begin_; }
  std::span<const int> rows() const { return rows_; }
  std::int64_t nonzeros() const { return static_cast<std::int64_t>(rows_.size()); }
  /// values[k] = the matrix entry at place k of the pattern.
  void scatter(const BlockMatrix& matrix, std::span<double> values) const;

 private:
  std::vector<int> column_begin_;
  std::vector<int> rows_;
  std::vector<std::int64_t> source_;  // place in the block values, for each nonzero
};

}  // namespace cairn
