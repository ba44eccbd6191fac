// SPDX-License-Identifier: BSD-3-Clause
#include "iterative/relaxation.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/core.h>

#include "iterative/vectors.hpp"

namespace cairn::iterative {
namespace {

/// Sweeps between two looks at the residual, which costs about as much as one.
constexpr std::int64_t kSweepsBetweenLooks = 16;

/// Multiplications that a solve without a limit of its own may take: a limit that grows with the
/// size would let the hopeless cases run for hours, a fixed number of sweeps would stop the small
/// ones early.
constexpr std::int64_t kWork = 300'000'000;

}  // namespace

Relaxation::Relaxation(std::string name, RelaxationOptions options)
    : name_(std::move(name)), options_(options) {}

void Relaxation::analyze(const BlockStructure& structure) {
  version_ = 0;
  factorized_ = false;
  H_.analyze(structure);
  diagonal_.analyze(structure);
  for (std::vector<double>* vector : {&g_, &x_, &r_, &scaled_, &best_})
    vector->assign(static_cast<std::size_t>(structure.size()), 0.0);
  version_ = structure.version();
  stats_ = {};
  stats_.ordering = "natural";
  progress_.reset(stats_, note(), options_.tolerance);
}

Factorization Relaxation::factorize(const BlockMatrix& H) {
  if (version_ == 0 || H.structure().version() != version_) {
    throw std::logic_error(
        fmt::format("linear_solver {}: factorize before analyze of that structure", name_));
  }
  factorized_ = false;
  if (const Factorization diagonal = diagonal_.factorize(H); !diagonal.ok) return diagonal;
  H_.load(H);
  prepare();
  progress_.describe(stats_, note());
  factorized_ = true;
  return {};
}

Relaxation::Norms Relaxation::norms(std::span<const double> r) {
  return {std::sqrt(dot(r, r)), std::sqrt(diagonal_.solve(r, scaled_))};
}

double Relaxation::look(std::span<const double> x, Norms& norm) {
  H_.multiply(x, r_);
  for (std::size_t k = 0; k < r_.size(); ++k) r_[k] = g_[k] - r_[k];
  norm = norms(r_);
  return -0.5 * (dot(x, g_) + dot(x, r_));  // Hx = g − r
}

std::int64_t Relaxation::limit() const {
  if (options_.max_iterations > 0) return options_.max_iterations;
  return std::max<std::int64_t>(kWork / (H_.values() * products_per_sweep()), 1);
}

double Relaxation::iterate(const Norms& whole, std::int64_t& iterations, Ending& ending) {
  std::fill(x_.begin(), x_.end(), 0.0);
  std::fill(best_.begin(), best_.end(), 0.0);
  double best_model = 0.0, best_norm = whole.plain;
  const std::int64_t most = limit();
  for (std::int64_t done = 0; done < most;) {
    const std::int64_t until = std::min(done + kSweepsBetweenLooks, most);
    for (; done < until; ++done, ++iterations) sweep(g_, x_);
    Norms norm;
    const double model = look(x_, norm);
    // Where φ no longer falls by more than rounding, rising is no sign of divergence.
    if (!(model <= best_model + 1e-12 * std::abs(best_model))) {
      ending = Ending::diverged;
      return best_norm;
    }
    best_model = std::min(model, best_model);
    best_norm = norm.plain;
    best_ = x_;
    if (norm.plain <= options_.tolerance * whole.plain &&
        norm.scaled <= options_.tolerance * whole.scaled) {
      ending = Ending::reached;
      return best_norm;
    }
  }
  ending = Ending::limit;
  return best_norm;
}

void Relaxation::solve(std::span<const double> g, std::span<double> x) {
  if (!factorized_) {
    throw std::logic_error(fmt::format("linear_solver {}: solve without a factorisation", name_));
  }
  std::copy(g.begin(), g.end(), g_.begin());  // x may be g
  const Norms whole = norms(g_);
  std::int64_t iterations = 0;
  Ending ending = Ending::reached;
  double norm = 0.0;
  if (whole.plain > 0.0) {
    do {
      norm = iterate(whole, iterations, ending);
    } while (ending == Ending::diverged && damp_more());
  } else {
    std::fill(best_.begin(), best_.end(), 0.0);
  }
  std::copy(best_.begin(), best_.end(), x.begin());
  progress_.describe(stats_, note());
  progress_.add(stats_, iterations, whole.plain > 0.0 ? norm / whole.plain : 0.0, ending);
}

}  // namespace cairn::iterative
