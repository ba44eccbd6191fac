// SPDX-License-Identifier: BSD-3-Clause
#include "schur_solver.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "cairn/linear/iterative_solver.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn {
namespace {

using schur::Eliminated;
using schur::Group;
using schur::Incidence;
using schur::Neighbour;
using schur::Stretch;
using schur::Target;

/// Blocks that one task of a solve works off.
constexpr std::size_t kBlocksOfTask = 256;
constexpr std::size_t kRowsOfTask = 8;

/// v = L⁻¹ v and v = L⁻ᵀ v, L holding reciprocals on its diagonal.
void solve_lower(const double* L, double* v, int size) {
  for (int j = 0; j < size; ++j) {
    v[j] *= L[j * size + j];
    for (int i = j + 1; i < size; ++i) v[i] -= L[j * size + i] * v[j];
  }
}
void solve_upper(const double* L, double* v, int size) {
  for (int j = size - 1; j >= 0; --j) {
    for (int i = j + 1; i < size; ++i) v[j] -= L[j * size + i] * v[i];
    v[j] *= L[j * size + j];
  }
}

/// Where a factorisation takes longer than the iterations that a step needs: of some thousand
/// unknowns, most of which are joined.
bool is_dense(const BlockStructure& reduced) {
  constexpr std::int64_t kLarge = 2500;
  const std::int64_t blocks = reduced.blocks(), pairs = blocks * (blocks + 1) / 2;
  return reduced.size() >= kLarge && 2 * reduced.entries() > pairs;
}

}  // namespace

SchurSolver::SchurSolver(std::unique_ptr<LinearSolver> inner,
                         std::unique_ptr<LinearSolver> of_dense, const SchurOptions& options)
    : inner_(std::move(inner)),
      of_dense_(std::move(of_dense)),
      chosen_(inner_.get()),
      inner_determinant_(query<LogDeterminant>(*inner_)),
      inner_order_(query<EliminationOrder>(*inner_)),
      inner_many_(query<ManyRightHandSides>(*inner_)),
      eliminate_(options.eliminate),
      kernels_(schur::choose_kernels(options.kernels.c_str())) {
  if (!kernels_) {
    throw Error(ErrorCode::usage, "linear_solver schur: this machine cannot run the kernels '" +
                                      options.kernels + "'; use auto");
  }
}

void SchurSolver::analyze(const BlockStructure& structure) {
  version_ = 0;
  factorized_ = false;
  order_.clear();
  plan_ = schur::SchurPlan(structure, eliminate_, *kernels_);
  S_ = BlockMatrix(plan_.reduced);
  L_.assign(plan_.l_values, 0.0);
  Y_.assign(plan_.y_values + schur::kOverread, 0.0);
  failed_.assign(plan_.elimination_tasks.size(), -1);
  z_.assign(plan_.parts, 0.0);
  y_.assign(plan_.reduced.size() + schur::kOverread, 0.0);
  vectors_.clear();
  for (const std::int32_t block : plan_.remaining) vectors_.push_back(structure.offsets()[block]);
  chosen_ = of_dense_ && is_dense(plan_.reduced) ? of_dense_.get() : inner_.get();
  if (!plan_.remaining.empty()) chosen_->analyze(plan_.reduced);
  marginals_.analyze(structure.sizes());
  version_ = structure.version();
  stats_ = {};
  stats_.ordering = "schur(" + std::to_string(plan_.eliminated.size()) + " eliminated)";
  if (!plan_.remaining.empty()) stats_.ordering += "+" + chosen_->stats().ordering;
  update_stats();
}

Factorization SchurSolver::factorize(const BlockMatrix& H) {
  if (version_ == 0 || H.structure().version() != version_)
    throw std::logic_error("linear_solver schur: factorize before analyze of that structure");
  factorized_ = false;
  if (!eliminate(H)) {
    const std::int32_t first = *std::ranges::find_if(failed_, [](auto k) { return k >= 0; });
    return {.ok = false, .failed_block = plan_.eliminated[first].block};
  }
  factorized_ = plan_.remaining.empty();
  if (factorized_) return {};
  reduce(H);
  Factorization factorization = chosen_->factorize(S_);
  if (factorization.failed_block >= 0)
    factorization.failed_block = plan_.remaining[factorization.failed_block];
  factorized_ = factorization.ok;
  update_stats();
  return factorization;
}

/// L of each eliminated block and Y of its neighbours.
bool SchurSolver::eliminate(const BlockMatrix& H) {
  const double* values = H.values().data();
  for_each_chunk(plan_.elimination_tasks.size(), [this, values](std::size_t task) {
    failed_[task] = -1;
    const Stretch& stretch = plan_.elimination_tasks[task];
    for (std::int64_t k = stretch.begin; k < stretch.end; ++k) {
      const Eliminated& element = plan_.eliminated[k];
      const Neighbour* neighbours = plan_.neighbours.data();
      const bool ok = kernels_->eliminate(element.size)(
          values, element.diagonal, neighbours + element.first_neighbour,
          neighbours + element.last_neighbour, L_.data() + element.factor, Y_.data(), element.size);
      if (!ok && failed_[task] < 0) failed_[task] = static_cast<std::int32_t>(k);
    }
  });
  return std::ranges::all_of(failed_, [](std::int32_t k) { return k < 0; });
}

/// S = H_RR − Y Yᵀ, a block at a time.
void SchurSolver::reduce(const BlockMatrix& H) {
  const double* values = H.values().data();
  for_each_chunk(plan_.target_tasks.size(), [this, values](std::size_t task) {
    const Stretch& stretch = plan_.target_tasks[task];
    for (std::int64_t t = stretch.begin; t < stretch.end; ++t) {
      const Target& target = plan_.targets[t];
      double* C = S_.values().data() + target.value;
      const int size = target.rows * target.columns;
      if (target.source >= 0) {
        std::copy_n(values + target.source, size, C);
      } else {
        std::fill_n(C, size, 0.0);
      }
      for (std::int64_t k = target.first_group; k < target.last_group; ++k) {
        const Group& group = plan_.groups[k];
        group.product(C, plan_.pairs.data() + group.first_pair,
                      plan_.pairs.data() + group.last_pair, Y_.data(), target.rows, target.columns,
                      group.inner);
      }
    }
  });
}

void SchurSolver::solve(std::span<const double> g, std::span<double> x) {
  if (!factorized_) throw std::logic_error("linear_solver schur: solve without a factorisation");
  const Side side{.g = g.data(), .x = x.data(), .z = z_.data(), .y = y_.data()};
  reduce(side);
  if (!plan_.remaining.empty()) {
    const std::span<double> y = std::span(y_).first(plan_.reduced.size());
    chosen_->solve(y, y);
  }
  substitute_back(side);
  update_stats();
}

void SchurSolver::solve(std::span<const double> G, std::span<double> X, int columns) {
  if (!factorized_) throw std::logic_error("linear_solver schur: solve without a factorisation");
  const std::int64_t rows = plan_.parts + plan_.reduced.size();
  z_.resize(std::max<std::size_t>(z_.size(), plan_.parts * columns));
  y_.resize(std::max<std::size_t>(y_.size(), plan_.reduced.size() * columns + schur::kOverread));
  const auto column = [&](std::int64_t k) {
    return Side{.g = G.data() + k * rows,
                .x = X.data() + k * rows,
                .z = z_.data() + k * plan_.parts,
                .y = y_.data() + k * plan_.reduced.size()};
  };
  for (int k = 0; k < columns; ++k) reduce(column(k));
  if (!plan_.remaining.empty()) {
    const std::span<double> Y = std::span(y_).first(plan_.reduced.size() * columns);
    inner_many_->solve(Y, Y, columns);
  }
  for (int k = 0; k < columns; ++k) substitute_back(column(k));
}

/// z = L⁻¹ g_E and y = g_R − Y z.
void SchurSolver::reduce(const Side& side) {
  for_each_range(plan_.eliminated.size(), kBlocksOfTask,
                 [this, &side](std::size_t begin, std::size_t end) {
                   for (std::size_t k = begin; k < end; ++k) {
                     const Eliminated& element = plan_.eliminated[k];
                     double* z = side.z + element.part;
                     std::copy_n(side.g + element.vector, element.size, z);
                     solve_lower(L_.data() + element.factor, z, element.size);
                   }
                 });
  for_each_range(plan_.remaining.size(), kRowsOfTask,
                 [this, &side](std::size_t begin, std::size_t end) {
                   for (std::size_t block = begin; block < end; ++block) reduce_row(side, block);
                 });
}

void SchurSolver::reduce_row(const Side& side, std::size_t block) {
  const int rows = plan_.reduced.sizes()[block];
  double* y = side.y + plan_.reduced.offsets()[block];
  std::copy_n(side.g + vectors_[block], rows, y);
  const Incidence* last = plan_.incidences.data() + plan_.incidence_begin[block + 1];
  for (const Incidence* first = plan_.incidences.data() + plan_.incidence_begin[block];
       first != last;) {
    const int inner = first->size;
    const Incidence* end =
        std::find_if(first, last, [inner](const Incidence& i) { return i.size != inner; });
    kernels_->forward(rows, inner)(first, end, Y_.data(), side.z, y, rows, inner);
    first = end;
  }
}

/// x_R = y, and x_E = L⁻ᵀ (z − Yᵀ y).
void SchurSolver::substitute_back(const Side& side) {
  for (std::size_t block = 0; block < plan_.remaining.size(); ++block) {
    std::copy_n(side.y + plan_.reduced.offsets()[block], plan_.reduced.sizes()[block],
                side.x + vectors_[block]);
  }
  for_each_range(plan_.eliminated.size(), kBlocksOfTask,
                 [this, &side](std::size_t begin, std::size_t end) {
                   for (std::size_t k = begin; k < end; ++k)
                     substitute_into(side, plan_.eliminated[k]);
                 });
}

void SchurSolver::substitute_into(const Side& side, const Eliminated& element) {
  double* z = side.z + element.part;
  const Neighbour* last = plan_.neighbours.data() + element.last_neighbour;
  for (const Neighbour* first = plan_.neighbours.data() + element.first_neighbour; first != last;) {
    const int rows = first->rows;
    const Neighbour* end =
        std::find_if(first, last, [rows](const Neighbour& n) { return n.rows != rows; });
    kernels_->backward(rows, element.size)(first, end, Y_.data(), plan_.reduced.offsets().data(),
                                           side.y, z, rows, element.size);
    first = end;
  }
  solve_upper(L_.data() + element.factor, z, element.size);
  std::copy_n(z, element.size, side.x + element.vector);
}

double SchurSolver::log_determinant() const {
  if (!factorized_)
    throw std::logic_error("linear_solver schur: log_determinant without a factorisation");
  double sum = plan_.remaining.empty() ? 0.0 : inner_determinant_->log_determinant();
  for (const Eliminated& element : plan_.eliminated) {
    for (int j = 0; j < element.size; ++j)
      sum -= 2.0 * std::log(L_[element.factor + j * element.size + j]);
  }
  return sum;
}

std::span<const std::int32_t> SchurSolver::elimination_order() const {
  if (order_.empty()) {
    for (const Eliminated& element : plan_.eliminated) order_.push_back(element.block);
    if (plan_.remaining.empty()) return order_;
    for (const std::int32_t block : inner_order_->elimination_order())
      order_.push_back(plan_.remaining[block]);
  }
  return order_;
}

void* SchurSolver::ability(std::string_view name) {
  // Exact where the inner solver is.
  if (name == IterativeSolver::kAbility) return query<IterativeSolver>(*chosen_);
  if (of_dense_) return nullptr;
  if (name == LogDeterminant::kAbility && inner_determinant_)
    return static_cast<LogDeterminant*>(this);
  if (name == EliminationOrder::kAbility && inner_order_)
    return static_cast<EliminationOrder*>(this);
  if (name == ManyRightHandSides::kAbility && inner_many_)
    return static_cast<ManyRightHandSides*>(this);
  if (name == Marginals::kAbility && query<Marginals>(*inner_))
    return static_cast<Marginals*>(&marginals_);
  return nullptr;
}

/// The inner solver's figures, which may change with each call, and those of the eliminated blocks.
void SchurSolver::update_stats() {
  stats_.factor_nonzeros = plan_.nonzeros;
  stats_.factor_flops = plan_.flops;
  if (plan_.remaining.empty()) return;
  const LinearSolverStats& inner = chosen_->stats();
  stats_.factor_nonzeros = inner.factor_nonzeros > 0 ? inner.factor_nonzeros + plan_.nonzeros : 0;
  stats_.factor_flops += inner.factor_flops;
  stats_.note = inner.note;
  stats_.iterations = inner.iterations;
  stats_.relative_residual = inner.relative_residual;
}

}  // namespace cairn
