// SPDX-License-Identifier: BSD-3-Clause
#include "pcg/pcg_solver.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "cairn/runtime/threads.hpp"
#include "iterative/vectors.hpp"
#include "pcg/block_jacobi.hpp"

namespace cairn {
namespace {

/// Times that the iteration begins anew from the true residual, which the recursive one drifts away
/// from by rounding.
constexpr int kRestarts = 3;
/// A solution that leaves more of g than this, in either norm, is as good as none.
constexpr double kUseless = 0.1;
/// H is singular along p if pᵀHp is not above this part of pᵀMp: rounding of the products.
constexpr double kSingular = 1e-14;

}  // namespace

using iterative::dot;
using iterative::Ending;

PcgSolver::PcgSolver(std::unique_ptr<Preconditioner> preconditioner, const PcgOptions& options)
    : preconditioner_(std::move(preconditioner)), options_(options) {}

void PcgSolver::analyze(const BlockStructure& structure) {
  version_ = 0;
  jacobian_version_ = 0;
  factorized_ = false;
  H_.analyze(structure);
  diagonal_.analyze(structure);
  preconditioner_->analyze(structure);
  for (std::vector<double>* vector : {&g_, &r_, &z_, &p_, &q_, &scaled_})
    vector->assign(static_cast<std::size_t>(structure.size()), 0.0);
  version_ = structure.version();
  stats_ = {};
  stats_.ordering = "natural";
  progress_.reset(stats_, preconditioner_->note(), options_.tolerance);
}

Factorization PcgSolver::factorize(const BlockMatrix& H) { return factorize(H, nullptr); }

Factorization PcgSolver::factorize(const BlockMatrix& H, const NormalBlocks* factors) {
  if (version_ == 0 || H.structure().version() != version_)
    throw std::logic_error("linear_solver pcg: factorize before analyze of that structure");
  factorized_ = false;
  if (const Factorization diagonal = diagonal_.factorize(H); !diagonal.ok) return diagonal;
  if (const Factorization made = preconditioner_->factorize(H, diagonal_, factors); !made.ok)
    return made;
  H_.load(H);
  progress_.describe(stats_, preconditioner_->note());
  factorized_ = true;
  return {};
}

void PcgSolver::analyze(const JacobianStructure& structure) {
  factors_.analyze(structure);
  normal_ = BlockMatrix(factors_.structure());
  analyze(factors_.structure());
  jacobian_version_ = structure.version();
}

Factorization PcgSolver::factorize(const JacobianMatrix& J, std::span<const double> damping) {
  if (jacobian_version_ == 0 || J.structure().version() != jacobian_version_)
    throw std::logic_error("linear_solver pcg: factorize before analyze of that structure");
  factors_.load(J, damping);
  factors_.assemble(normal_);
  return factorize(normal_, &factors_);
}

void PcgSolver::minimize(std::span<const double> residual, std::span<double> x) {
  if (!factorized_ || jacobian_version_ == 0)
    throw std::logic_error("linear_solver pcg: minimize without a factorisation");
  factors_.J().multiply_transposed(residual, x);
  for (double& value : x) value = -value;
  solve(x, x);
}

void* PcgSolver::ability(std::string_view name) {
  if (name == IterativeSolver::kAbility) return static_cast<IterativeSolver*>(this);
  const bool wanted = name == JacobianSolver::kAbility && preconditioner_->wants_factors();
  return wanted ? static_cast<JacobianSolver*>(this) : nullptr;
}

PcgSolver::Norms PcgSolver::true_residual(std::span<const double> x) {
  H_.multiply(x, q_);
  for (std::size_t k = 0; k < r_.size(); ++k) r_[k] = g_[k] - q_[k];
  return {std::sqrt(dot(r_, r_)), scaled_norm()};
}

double PcgSolver::scaled_norm() { return std::sqrt(diagonal_.solve(r_, scaled_)); }

double PcgSolver::step(double alpha, std::span<double> x) {
  return iterative::sum_over_ranges(r_.size(), [&](std::size_t begin, std::size_t end) {
    double sum = 0.0;
    for (std::size_t k = begin; k < end; ++k) {
      x[k] += alpha * p_[k];
      r_[k] -= alpha * q_[k];
      sum += r_[k] * r_[k];
    }
    return sum;
  });
}

Ending PcgSolver::iterate(Preconditioner& preconditioner, const Norms& goal, std::span<double> x,
                          std::int64_t& iterations) {
  double rz = preconditioner.apply(r_, z_);
  p_ = z_;
  double pMp = rz;
  while (iterations < options_.max_iterations) {
    const double curvature = H_.multiply_dot(p_, q_);
    if (!(curvature > kSingular * pMp)) return Ending::indefinite;
    ++iterations;
    if (std::sqrt(step(rz / curvature, x)) <= goal.plain && scaled_norm() <= goal.scaled)
      return Ending::reached;
    const double next = preconditioner.apply(r_, z_);
    if (!(next > 0.0)) return Ending::indefinite;
    const double beta = next / rz;
    rz = next;
    pMp = rz + beta * beta * pMp;  // z is orthogonal to M p
    iterative::sum_over_ranges(p_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) p_[k] = z_[k] + beta * p_[k];
      return 0.0;
    });
  }
  return Ending::limit;
}

PcgSolver::Outcome PcgSolver::solve_with(Preconditioner& preconditioner, const Norms& whole,
                                         std::span<double> x, std::int64_t& iterations) {
  const double part = std::max(options_.tolerance, forcing_);
  const Norms goal{part * whole.plain, part * whole.scaled};
  r_ = g_;
  std::fill(x.begin(), x.end(), 0.0);
  Outcome outcome{whole, Ending::reached};
  for (int restart = 0; !outcome.residual.within(goal) && restart <= kRestarts; ++restart) {
    const Norms before = outcome.residual;
    outcome.ending = iterate(preconditioner, goal, x, iterations);
    outcome.residual = true_residual(x);
    if (outcome.ending != Ending::reached) break;
    if (outcome.residual.within(goal)) break;
    outcome.ending = Ending::stagnated;  // unless another round mends it
    if (outcome.residual.plain > 0.5 * before.plain &&
        outcome.residual.scaled > 0.5 * before.scaled)
      break;
  }
  if (outcome.residual.within(goal)) outcome.ending = Ending::reached;
  return outcome;
}

void PcgSolver::solve(std::span<const double> g, std::span<double> x) {
  if (!factorized_) throw std::logic_error("linear_solver pcg: solve without a factorisation");
  std::copy(g.begin(), g.end(), g_.begin());  // x may be g
  r_ = g_;
  const Norms whole{std::sqrt(dot(g_, g_)), scaled_norm()};
  const Norms useful{kUseless * whole.plain, kUseless * whole.scaled};
  std::int64_t iterations = 0;
  Outcome outcome = solve_with(*preconditioner_, whole, x, iterations);
  if (!outcome.residual.within(useful) && outcome.ending != Ending::limit) {
    // Near the minimum of a graph with a gauge freedom g is small, and a preconditioner that is
    // nearly singular makes a step of what rounding leaves of g in the free direction. The diagonal
    // blocks do not.
    BlockJacobi robust(diagonal_);
    outcome = solve_with(robust, whole, x, iterations);
  }
  progress_.add(stats_, iterations, whole.plain > 0.0 ? outcome.residual.plain / whole.plain : 0.0,
                outcome.ending);
}

}  // namespace cairn
