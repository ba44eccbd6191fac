// SPDX-License-Identifier: BSD-3-Clause
#include "cholmod_solver.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>

#include <fmt/core.h>

#include "blas_threads.hpp"
#include "cairn/runtime/error.hpp"
#include "cholmod_ordering.hpp"

namespace cairn {
namespace {

[[noreturn]] void throw_cholmod_error(const char* during, int status) {
  if (status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
  if (status == CHOLMOD_TOO_LARGE) {
    throw Error(ErrorCode::usage,
                "linear_solver cholmod: the factor has more scalars than 32-bit indices can count; "
                "use block_cholesky");
  }
  throw std::logic_error(
      fmt::format("linear_solver cholmod: CHOLMOD ended {} with status {}", during, status));
}

}  // namespace

CholmodSolver::CholmodSolver(const CholmodOptions& options) : ordering_(options.ordering) {
  cholmod_start(&common_);
  common_.print = 0;
  common_.try_catch = 1;  // statuses only: no message, no handler
  common_.error_handler = nullptr;
  common_.supernodal = options.mode == CholmodMode::simplicial   ? CHOLMOD_SIMPLICIAL
                       : options.mode == CholmodMode::supernodal ? CHOLMOD_SUPERNODAL
                                                                 : CHOLMOD_AUTO;
  common_.final_ll = 1;  // LLᵀ stops at the first pivot that is not positive; LDLᵀ would go on
  common_.quick_return_if_not_posdef = 1;
  common_.nmethods = 1;
  common_.method[0].ordering = CHOLMOD_GIVEN;
  common_.postorder = 1;  // same fill, and columns that belong together side by side
  keep_blas_to_one_thread();
}

CholmodSolver::~CholmodSolver() {
  free_factor();
  cholmod_free_dense(&x_, &common_);
  cholmod_free_dense(&y_, &common_);
  cholmod_free_dense(&e_, &common_);
  cholmod_finish(&common_);
}

void CholmodSolver::free_factor() {
  if (L_) cholmod_free_factor(&L_, &common_);
  factorized_ = false;
}

cholmod_sparse CholmodSolver::matrix() {
  cholmod_sparse matrix{};
  matrix.nrow = matrix.ncol = static_cast<std::size_t>(pattern_.size());
  matrix.nzmax = static_cast<std::size_t>(pattern_.nonzeros());
  // CHOLMOD only reads them; its interface is older than const.
  matrix.p = const_cast<int*>(pattern_.column_begin().data());
  matrix.i = const_cast<int*>(pattern_.rows().data());
  matrix.x = values_.data();
  matrix.stype = -1;  // lower
  matrix.itype = CHOLMOD_INT;
  matrix.xtype = CHOLMOD_REAL;
  matrix.dtype = CHOLMOD_DOUBLE;
  matrix.sorted = 1;
  matrix.packed = 1;
  return matrix;
}

void CholmodSolver::analyze(const BlockStructure& structure) {
  free_factor();
  version_ = 0;
  pattern_ = ScalarPattern(structure, ScalarPattern::Triangle::lower);
  values_.assign(pattern_.nonzeros(), 0.0);
  block_of_scalar_.clear();
  block_of_scalar_.reserve(structure.size());
  for (int block = 0; block < structure.blocks(); ++block) {
    block_of_scalar_.insert(block_of_scalar_.end(), structure.block_size(block), block);
  }

  std::vector<int> order = order_scalars(structure, ordering_, common_);
  cholmod_sparse A = matrix();
  L_ = cholmod_analyze_p(&A, order.data(), nullptr, 0, &common_);
  if (!L_) throw_cholmod_error("the analysis", common_.status);

  marginals_.analyze(structure.sizes());
  version_ = structure.version();
  stats_ = {};
  stats_.ordering = ordering_;
  stats_.factor_nonzeros = static_cast<std::int64_t>(common_.lnz);
  stats_.factor_flops = common_.fl;
  stats_.note = L_->is_super ? "supernodal" : "simplicial";
}

Factorization CholmodSolver::factorize(const BlockMatrix& H) {
  if (!L_ || H.structure().version() != version_) {
    throw std::logic_error("linear_solver cholmod: factorize before analyze of that structure");
  }
  pattern_.scatter(H, values_);
  cholmod_sparse A = matrix();
  factorized_ = false;
  const AsManyThreads as_many;
  if (!cholmod_factorize(&A, L_, &common_)) throw_cholmod_error("a factorisation", common_.status);
  if (common_.status == CHOLMOD_NOT_POSDEF || L_->minor < L_->n) return failed_at(L_->minor);
  read_pivots();
  // A pivot that is no number passes CHOLMOD's own test.
  const auto bad = std::find_if_not(pivots_.begin(), pivots_.end(),
                                    [](double p) { return p > 0.0 && std::isfinite(p); });
  if (bad != pivots_.end()) return failed_at(static_cast<std::size_t>(bad - pivots_.begin()));
  factorized_ = true;
  return {};
}

void CholmodSolver::read_pivots() {
  pivots_.clear();
  pivots_.reserve(L_->n);
  const double* values = static_cast<const double*>(L_->x);
  if (!L_->is_super) {
    const int* begin = static_cast<const int*>(L_->p);
    for (std::size_t k = 0; k < L_->n; ++k) pivots_.push_back(values[begin[k]]);
    return;
  }
  const int* first_column = static_cast<const int*>(L_->super);
  const int* first_row = static_cast<const int*>(L_->pi);
  const int* first_value = static_cast<const int*>(L_->px);
  for (std::size_t s = 0; s < L_->nsuper; ++s) {
    const int columns = first_column[s + 1] - first_column[s],
              rows = first_row[s + 1] - first_row[s];
    for (int k = 0; k < columns; ++k) {
      pivots_.push_back(values[first_value[s] + static_cast<std::ptrdiff_t>(k) * (rows + 1)]);
    }
  }
}

Factorization CholmodSolver::failed_at(std::size_t column) const {
  if (column >= L_->n) return {false, -1};
  return {false, block_of_scalar_[static_cast<const int*>(L_->Perm)[column]]};
}

void CholmodSolver::solve(std::span<const double> g, std::span<double> x) { solve(g, x, 1); }

void CholmodSolver::solve(std::span<const double> G, std::span<double> X, int columns) {
  if (!factorized_) throw std::logic_error("linear_solver cholmod: solve without a factorisation");
  if (columns == 0) return;
  cholmod_dense right{};
  right.ncol = static_cast<std::size_t>(columns);
  right.nrow = right.d = G.size() / right.ncol;
  right.nzmax = G.size();
  right.x = const_cast<double*>(G.data());  // only read
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_DOUBLE;
  const AsManyThreads as_many;
  if (!cholmod_solve2(CHOLMOD_A, L_, &right, nullptr, &x_, nullptr, &y_, &e_, &common_)) {
    throw_cholmod_error("a solve", common_.status);
  }
  std::copy_n(static_cast<const double*>(x_->x), X.size(), X.begin());
}

double CholmodSolver::log_determinant() const {
  if (!factorized_)
    throw std::logic_error("linear_solver cholmod: log_determinant without a factorisation");
  double sum = 0.0;
  for (const double pivot : pivots_) sum += std::log(pivot);
  return 2.0 * sum;
}

void* CholmodSolver::ability(std::string_view name) {
  if (name == LogDeterminant::kAbility) return static_cast<LogDeterminant*>(this);
  if (name == ManyRightHandSides::kAbility) return static_cast<ManyRightHandSides*>(this);
  if (name == Marginals::kAbility) return static_cast<Marginals*>(&marginals_);
  return nullptr;
}

}  // namespace cairn
