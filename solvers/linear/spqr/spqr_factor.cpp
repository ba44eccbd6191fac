// SPDX-License-Identifier: BSD-3-Clause
#include "spqr_factor.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>

#include <fmt/core.h>

namespace cairn {
namespace {

/// A column counts as dependent on those before it if what is left of it is below this share of its
/// own length: some hundred times the rounding of a Householder transformation.
constexpr double kDependent = 1e-13;

[[noreturn]] void throw_spqr_error(const char* during, int status) {
  if (status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
  throw std::logic_error(
      fmt::format("linear_solver spqr: SuiteSparseQR ended {} with status {}", during, status));
}

/// The entries of each block column of J, by rising block row.
struct ColumnEntries {
  std::vector<std::int64_t> begin, entry;
  std::vector<std::int32_t> row;

  explicit ColumnEntries(const JacobianStructure& s)
      : begin(static_cast<std::size_t>(s.block_columns()) + 1, 0),
        entry(static_cast<std::size_t>(s.entries())),
        row(static_cast<std::size_t>(s.entries())) {
    for (const std::int32_t column : s.columns()) ++begin[column + 1];
    for (std::size_t k = 1; k < begin.size(); ++k) begin[k] += begin[k - 1];
    std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
    for (int i = 0; i < s.block_rows(); ++i) {
      for (std::int64_t e = s.row_begin()[i]; e < s.row_begin()[i + 1]; ++e) {
        const std::int64_t place = next[s.columns()[e]]++;
        entry[place] = e;
        row[place] = i;
      }
    }
  }
};

}  // namespace

SpqrFactor::SpqrFactor(const JacobianStructure& structure, std::span<const std::int32_t> order,
                       bool damped, cholmod_common& common)
    : common_(common), rows_(static_cast<std::size_t>(structure.rows())) {
  if (damped) rows_ += static_cast<std::size_t>(structure.size());
  build_pattern(structure, order, damped);
  values_.assign(row_of_.size(), 0.0);
  right_.assign(rows_, 0.0);
  diagonal_.assign(column_begin_.size() - 1, 0.0);
  cholmod_sparse A = matrix();
  // Without SuiteSparseQR's own tolerance, which is one number for columns of all units.
  qr_ = SuiteSparseQR_symbolic<double>(SPQR_ORDERING_FIXED, 0, &A, &common_);
  if (!qr_) throw_spqr_error("the analysis", common_.status);
  factor_nonzeros_ = static_cast<std::int64_t>(common_.lnz);
}

SpqrFactor::~SpqrFactor() {
  if (qr_) SuiteSparseQR_free<double>(&qr_, &common_);
}

void SpqrFactor::build_pattern(const JacobianStructure& s, std::span<const std::int32_t> order,
                               bool damped) {
  const ColumnEntries entries(s);
  const std::size_t nonzeros =
      static_cast<std::size_t>(s.values()) + (damped ? static_cast<std::size_t>(s.size()) : 0);
  row_of_.reserve(nonzeros);
  source_.reserve(nonzeros);
  column_begin_.reserve(static_cast<std::size_t>(s.size()) + 1);
  column_begin_.push_back(0);
  for (const std::int32_t block : order) {
    for (std::int32_t c = 0; c < s.column_sizes()[block]; ++c) {
      for (std::int64_t k = entries.begin[block]; k < entries.begin[block + 1]; ++k) {
        const std::int32_t row = entries.row[k], rows = s.row_sizes()[row];
        for (std::int32_t r = 0; r < rows; ++r) {
          row_of_.push_back(s.row_offsets()[row] + r);
          source_.push_back(s.value_begin()[entries.entry[k]] +
                            static_cast<std::int64_t>(c) * rows + r);
        }
      }
      if (damped) {
        const std::int64_t scalar = s.column_offsets()[block] + c;
        row_of_.push_back(s.rows() + scalar);
        source_.push_back(~scalar);
      }
      column_begin_.push_back(static_cast<SuiteSparse_long>(row_of_.size()));
    }
  }
}

cholmod_sparse SpqrFactor::matrix() {
  cholmod_sparse A{};
  A.nrow = rows_;
  A.ncol = column_begin_.size() - 1;
  A.nzmax = row_of_.size();
  A.p = column_begin_.data();
  A.i = row_of_.data();
  A.x = values_.data();
  A.stype = 0;
  A.itype = CHOLMOD_LONG;
  A.xtype = CHOLMOD_REAL;
  A.dtype = CHOLMOD_DOUBLE;
  A.sorted = 1;
  A.packed = 1;
  return A;
}

std::int64_t SpqrFactor::factorize(const JacobianMatrix& J, std::span<const double> damping) {
  const double* values = J.values().data();
  for (std::size_t k = 0; k < source_.size(); ++k)
    values_[k] = source_[k] >= 0 ? values[source_[k]] : std::sqrt(damping[~source_[k]]);

  // SuiteSparseQR does not promise to return from numbers that are not finite.
  const std::size_t columns = diagonal_.size();
  std::vector<double>& length = right_;  // room that is free until `minimize`
  length.assign(std::max(rows_, columns), 0.0);
  for (std::size_t j = 0; j < columns; ++j) {
    double sum = 0.0;
    for (auto k = column_begin_[j]; k < column_begin_[j + 1]; ++k) sum += values_[k] * values_[k];
    if (!std::isfinite(sum)) return static_cast<std::int64_t>(j);
    length[j] = std::sqrt(sum);
  }

  cholmod_sparse A = matrix();
  if (!SuiteSparseQR_numeric<double>(SPQR_NO_TOL, &A, qr_, &common_))
    throw_spqr_error("a factorisation", common_.status);
  factor_flops_ = common_.SPQR_flopcount;
  read_diagonal();
  for (std::size_t j = 0; j < columns; ++j) {
    if (!(diagonal_[j] > kDependent * length[j])) return static_cast<std::int64_t>(j);
  }
  return -1;
}

/// Each front holds its columns packed one behind the other: of a column the part in R, which grows
/// by one with each pivot, and below it the Householder vector. A column whose staircase is zero,
/// or that comes after the front's last row, has no pivot: its diagonal is zero.
void SpqrFactor::read_diagonal() {
  const spqr_symbolic& symbolic = *qr_->QRsym;
  const spqr_numeric<double>& numeric = *qr_->QRnum;
  for (SuiteSparse_long front = 0; front < symbolic.nf; ++front) {
    const double* column = numeric.Rblock[front];
    const SuiteSparse_long* staircase = numeric.HStair + symbolic.Rp[front];
    const SuiteSparse_long first = symbolic.Super[front], last = symbolic.Super[front + 1];
    SuiteSparse_long pivots = 0;
    for (SuiteSparse_long k = 0; k < last - first; ++k) {
      const SuiteSparse_long length = staircase[k];
      const bool live = length > 0 && pivots < numeric.Hm[front];
      diagonal_[first + k] = live ? std::abs(column[pivots]) : 0.0;
      if (live) ++pivots;
      column += std::max(length, pivots);
    }
  }
}

void SpqrFactor::minimize(std::span<const double> residual, std::span<double> x) {
  right_.assign(rows_, 0.0);
  for (std::size_t k = 0; k < residual.size(); ++k) right_[k] = -residual[k];
  cholmod_dense right{};
  right.nrow = right.nzmax = right.d = rows_;
  right.ncol = 1;
  right.x = right_.data();
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* rotated = SuiteSparseQR_qmult<double>(SPQR_QTX, qr_, &right, &common_);
  if (!rotated) throw_spqr_error("a solve", common_.status);
  cholmod_dense* solution = SuiteSparseQR_solve<double>(SPQR_RETX_EQUALS_B, qr_, rotated, &common_);
  cholmod_l_free_dense(&rotated, &common_);
  copy_solution(solution, x);
}

void SpqrFactor::solve_normal(std::span<const double> g, std::span<double> x) {
  cholmod_dense right{};
  right.nrow = right.nzmax = right.d = g.size();
  right.ncol = 1;
  right.x = const_cast<double*>(g.data());  // only read
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* half = SuiteSparseQR_solve<double>(SPQR_RTX_EQUALS_ETB, qr_, &right, &common_);
  if (!half) throw_spqr_error("a solve", common_.status);
  cholmod_dense* solution = SuiteSparseQR_solve<double>(SPQR_RETX_EQUALS_B, qr_, half, &common_);
  cholmod_l_free_dense(&half, &common_);
  copy_solution(solution, x);
}

/// Takes what SuiteSparseQR returned, and frees it.
void SpqrFactor::copy_solution(cholmod_dense* solution, std::span<double> x) {
  if (!solution) throw_spqr_error("a solve", common_.status);
  std::copy_n(static_cast<const double*>(solution->x), x.size(), x.begin());
  cholmod_l_free_dense(&solution, &common_);
}

}  // namespace cairn
