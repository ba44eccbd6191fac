// SPDX-License-Identifier: BSD-3-Clause
#include "spqr_solver.hpp"

#include <cmath>
#include <stdexcept>

#include "blas_threads.hpp"
#include "cairn/runtime/error.hpp"
#include "spqr_ordering.hpp"

namespace cairn {

SpqrSolver::SpqrSolver(const SpqrOptions& options) : ordering_(options.ordering) {
  cholmod_l_start(&common_);
  common_.print = 0;
  common_.try_catch = 1;  // statuses only: no message, no handler
  common_.error_handler = nullptr;
  common_.nmethods = 1;
  common_.postorder = 1;
  common_.SPQR_nthreads = 1;
  common_.SPQR_grain = 1;  // one task: sums in one order
  keep_blas_to_one_thread();
}

SpqrSolver::~SpqrSolver() {
  plain_.reset();
  damped_.reset();
  cholmod_l_finish(&common_);
}

void SpqrSolver::analyze(const JacobianStructure& structure) {
  current_ = nullptr;
  version_ = 0;
  plain_.reset();
  damped_.reset();
  order_ = order_columns(structure, ordering_, common_);
  block_.clear();
  scalar_.clear();
  for (const std::int32_t block : order_) {
    for (std::int64_t k = structure.column_offsets()[block];
         k < structure.column_offsets()[block + 1]; ++k) {
      block_.push_back(block);
      scalar_.push_back(k);
    }
  }
  permuted_.resize(scalar_.size());
  plain_.emplace(structure, order_, false, common_);
  marginals_.analyze(structure.column_sizes());
  structure_ = &structure;
  version_ = structure.version();
  stats_ = {};
  stats_.ordering = ordering_;
  stats_.factor_nonzeros = plain_->factor_nonzeros();
  stats_.note = "multifrontal QR";
}

Factorization SpqrSolver::factorize(const JacobianMatrix& J, std::span<const double> damping) {
  if (version_ == 0 || J.structure().version() != version_)
    throw std::logic_error("linear_solver spqr: factorize before analyze of that structure");
  current_ = nullptr;
  if (!damping.empty() && !damped_) damped_.emplace(J.structure(), order_, true, common_);
  SpqrFactor& factor = damping.empty() ? *plain_ : *damped_;
  const std::int64_t failed = factor.factorize(J, damping);
  stats_.factor_flops = factor.factor_flops();
  if (failed >= 0) return {false, block_[failed]};
  current_ = &factor;
  return {};
}

void SpqrSolver::minimize(std::span<const double> residual, std::span<double> x) {
  if (!current_) throw std::logic_error("linear_solver spqr: minimize without a factorisation");
  current_->minimize(residual, permuted_);
  for (std::size_t k = 0; k < scalar_.size(); ++k) x[scalar_[k]] = permuted_[k];
}

double SpqrSolver::log_determinant() const {
  if (!current_)
    throw std::logic_error("linear_solver spqr: log_determinant without a factorisation");
  double sum = 0.0;
  for (const double pivot : current_->diagonal()) sum += std::log(pivot);
  return 2.0 * sum;
}

void* SpqrSolver::ability(std::string_view name) {
  if (name == JacobianSolver::kAbility) return static_cast<JacobianSolver*>(this);
  if (name == LogDeterminant::kAbility) return static_cast<LogDeterminant*>(this);
  if (name == Marginals::kAbility) return static_cast<Marginals*>(&marginals_);
  return nullptr;
}

void SpqrSolver::analyze(const BlockStructure&) {
  throw Error(ErrorCode::usage,
              "linear_solver spqr factorises the Jacobian, and here only H = JᵀJ is available, as "
              "for a reduced system; use block_cholesky, cholmod or eigen here, or spqr as the "
              "linear solver of the optimizer itself");
}

Factorization SpqrSolver::factorize(const BlockMatrix&) {
  throw std::logic_error("linear_solver spqr: factorize of H, which it cannot analyze");
}

void SpqrSolver::solve(std::span<const double> g, std::span<double> x) {
  if (!current_) throw std::logic_error("linear_solver spqr: solve without a factorisation");
  for (std::size_t k = 0; k < scalar_.size(); ++k) permuted_[k] = g[scalar_[k]];
  current_->solve_normal(permuted_, permuted_);
  for (std::size_t k = 0; k < scalar_.size(); ++k) x[scalar_[k]] = permuted_[k];
}

}  // namespace cairn
