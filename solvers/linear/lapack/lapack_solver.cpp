// SPDX-License-Identifier: BSD-3-Clause
#include "lapack_solver.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/core.h>

#include "blas_threads.hpp"
#include "cairn/runtime/error.hpp"

// The Fortran interface, which every LAPACK has; Debian's LAPACKE is a package of its own.
extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dpotrs_(const char* uplo, const int* n, const int* nrhs, const double* a, const int* lda,
             double* b, const int* ldb, int* info);
}

namespace cairn {

LapackSolver::LapackSolver(const LapackOptions& options) : max_size_(options.max_size) {
  keep_blas_to_one_thread();
}

void LapackSolver::analyze(const BlockStructure& structure) {
  version_ = 0;
  factorized_ = false;
  const std::int64_t n = structure.size();
  if (n > max_size_) {
    throw Error(ErrorCode::usage,
                fmt::format("linear_solver lapack: {} unknowns are beyond its max_size of {} (a "
                            "dense matrix of them takes {:.1f} GB); use block_cholesky, cholmod or "
                            "eigen, or raise max_size",
                            n, max_size_, 8e-9 * static_cast<double>(n) * static_cast<double>(n)));
  }
  size_ = static_cast<int>(n);
  dense_.assign(static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 0.0);
  block_of_scalar_.clear();
  for (int block = 0; block < structure.blocks(); ++block)
    block_of_scalar_.insert(block_of_scalar_.end(), structure.block_size(block), block);

  marginals_.analyze(structure.sizes());
  version_ = structure.version();
  const auto size = static_cast<double>(n);
  stats_ = {};
  stats_.ordering = "natural";
  stats_.factor_nonzeros = n * (n + 1) / 2;
  stats_.factor_flops = size * (size + 1.0) * (2.0 * size + 1.0) / 6.0;
  stats_.note = "dense";
}

void LapackSolver::scatter(const BlockMatrix& H) {
  const BlockStructure& s = H.structure();
  std::fill(dense_.begin(), dense_.end(), 0.0);
  for (int j = 0; j < s.blocks(); ++j) {
    for (std::int64_t e = s.column_begin()[j]; e < s.column_begin()[j + 1]; ++e) {
      const int i = s.rows()[e], rows = s.block_size(i);
      for (int c = 0; c < s.block_size(j); ++c) {
        std::copy_n(H.block(e) + static_cast<std::ptrdiff_t>(c) * rows, rows,
                    dense_.data() + (s.offsets()[j] + c) * size_ + s.offsets()[i]);
      }
    }
  }
}

Factorization LapackSolver::failed_at(std::int64_t scalar) const {
  return {false, block_of_scalar_[scalar]};
}

Factorization LapackSolver::factorize(const BlockMatrix& H) {
  if (version_ == 0 || H.structure().version() != version_)
    throw std::logic_error("linear_solver lapack: factorize before analyze of that structure");
  factorized_ = false;
  scatter(H);
  int info = 0;
  dpotrf_("L", &size_, dense_.data(), &size_, &info);
  if (info < 0) throw std::logic_error(fmt::format("linear_solver lapack: dpotrf ended {}", info));
  if (info > 0) return failed_at(info - 1);
  // A pivot that is no number passes the test of some LAPACKs.
  for (std::int64_t k = 0; k < size_; ++k) {
    const double pivot = dense_[k * size_ + k];
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return failed_at(k);
  }
  factorized_ = true;
  return {};
}

void LapackSolver::solve(std::span<const double> g, std::span<double> x) {
  if (!factorized_) throw std::logic_error("linear_solver lapack: solve without a factorisation");
  if (x.data() != g.data()) std::copy(g.begin(), g.end(), x.begin());
  const int one = 1;
  int info = 0;
  dpotrs_("L", &size_, &one, dense_.data(), &size_, x.data(), &size_, &info);
  if (info != 0) throw std::logic_error(fmt::format("linear_solver lapack: dpotrs ended {}", info));
}

double LapackSolver::log_determinant() const {
  if (!factorized_)
    throw std::logic_error("linear_solver lapack: log_determinant without a factorisation");
  double sum = 0.0;
  for (std::int64_t k = 0; k < size_; ++k) sum += std::log(dense_[k * size_ + k]);
  return 2.0 * sum;
}

void* LapackSolver::ability(std::string_view name) {
  if (name == LogDeterminant::kAbility) return static_cast<LogDeterminant*>(this);
  if (name == Marginals::kAbility) return static_cast<Marginals*>(&marginals_);
  return nullptr;
}

}  // namespace cairn
