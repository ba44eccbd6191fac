// SPDX-License-Identifier: BSD-3-Clause
#include "block/refined_cholesky.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cairn/runtime/error.hpp"

namespace cairn::block {
namespace {

/// Of the scaled residual.
constexpr double kTolerance = 1e-15;
/// With more steps than this, double precision is the faster one on any graph.
constexpr int kMostSteps = 10;
/// How often the steps begin anew because rounding has led the residual that they carry along away
/// from the true one.
constexpr int kMostStarts = 2;
/// A pivot that is a smaller share of its diagonal entry may be rounding, 6e-8, and little else.
constexpr double kSmallestPivot = 1e-6;

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace

void RefinedCholesky::analyze(const BlockStructure& structure, std::string_view ordering) {
  cholesky_.analyze(structure, ordering);
  falls_back_ = is_single_ = false;
  reason_.clear();
  solutions_ = steps_ = 0;
  if (precision_ == Precision::in_double) return;
  H_ = BlockMatrix(structure);
  const auto size = static_cast<std::size_t>(structure.size());
  for (std::vector<double>* numbers : {&d_, &inverse_d_, &g_, &x_, &r_, &z_, &p_, &q_})
    numbers->assign(size, 0.0);
}

Factorization RefinedCholesky::factorize(const BlockMatrix& H) {
  is_single_ = false;
  if (precision_ == Precision::in_double || falls_back_) return cholesky_.factorize(H);
  is_single_ = cholesky_.factorize_single(H).ok;
  std::ranges::copy(H.values(), H_.values().begin());
  if (!is_single_) return fall_back("a pivot is not positive in single precision");
  H_.diagonal(d_);
  for (std::size_t k = 0; k < d_.size(); ++k) {
    d_[k] = std::sqrt(d_[k]);
    inverse_d_[k] = 1.0 / d_[k];
  }
  if (!has_safe_pivots()) return fall_back("a pivot is too small for single precision");
  return {};
}

/// One that fails in double precision too says nothing about the next.
Factorization RefinedCholesky::fall_back(std::string_view reason) {
  is_single_ = false;
  const Factorization result = cholesky_.factorize(H_);
  falls_back_ = result.ok;
  if (result.ok) reason_ = reason;
  return result;
}

bool RefinedCholesky::has_safe_pivots() const {
  const auto share = cholesky_.smallest_single_pivot(d_);
  return share * share >= kSmallestPivot;
}

void RefinedCholesky::require_double() {
  if (!is_single_) return;
  is_single_ = false;
  if (!cholesky_.factorize(H_).ok)
    throw Error(ErrorCode::numerical,
                "H is singular to double precision: it has no inverse and no determinant");
}

void RefinedCholesky::solve(std::span<const double> g, std::span<double> x) {
  if (is_single_) {
    ++solutions_;
    // By a power of two: products of tiny residuals would vanish, those of huge ones overflow.
    double largest = 0.0;
    for (const double value : g) largest = std::max(largest, std::abs(value));
    const int exponent =
        largest > 0.0 && std::isfinite(largest) ? std::clamp(std::ilogb(largest), -1000, 1000) : 0;
    const double down = std::ldexp(1.0, -exponent), up = std::ldexp(1.0, exponent);
    for (std::size_t k = 0; k < g_.size(); ++k) g_[k] = g[k] * down;
    if (refine()) {
      for (std::size_t k = 0; k < x_.size(); ++k) x[k] = x_[k] * up;
      return;
    }
    if (!fall_back("ten steps of refinement were not enough").ok) {
      std::ranges::fill(x, std::numeric_limits<double>::quiet_NaN());
      return;
    }
  }
  cholesky_.solve(g, x);
}

bool RefinedCholesky::refine() {
  std::ranges::fill(x_, 0.0);
  std::ranges::copy(g_, r_.begin());
  scaled_g_ = 0.0;
  for (std::size_t k = 0; k < r_.size(); ++k)
    scaled_g_ = std::max(scaled_g_, std::abs(g_[k]) * inverse_d_[k]);
  for (int start = 0; start < kMostStarts; ++start) {
    if (!take_steps()) return false;
    H_.multiply(x_, r_);
    for (std::size_t k = 0; k < r_.size(); ++k) r_[k] = g_[k] - r_[k];
    if (is_accurate()) return true;
  }
  return false;
}

/// Preconditioned conjugate gradients from x_ and its residual r_ on. They end by the residual that
/// they carry along.
bool RefinedCholesky::take_steps() {
  double before = 0.0;
  std::ranges::fill(p_, 0.0);
  for (int step = 0; step < kMostSteps && !is_accurate(); ++step) {
    precondition();
    const double now = dot(r_, z_);
    const double beta = step == 0 ? 0.0 : now / before;
    before = now;
    for (std::size_t k = 0; k < p_.size(); ++k) p_[k] = z_[k] + beta * p_[k];
    H_.multiply(p_, q_);
    const double alpha = now / dot(p_, q_);
    if (!(alpha > 0.0 && std::isfinite(alpha))) return false;
    for (std::size_t k = 0; k < p_.size(); ++k) {
      x_[k] += alpha * p_[k];
      r_[k] -= alpha * q_[k];
    }
    ++steps_;
  }
  return is_accurate();
}

/// z = M⁻¹ r, scaled so that single precision has room for it.
void RefinedCholesky::precondition() {
  double largest = 0.0;
  for (const double r : r_) largest = std::max(largest, std::abs(r));
  const double scale = largest > 0.0 ? 1.0 / largest : 1.0;
  for (std::size_t k = 0; k < r_.size(); ++k) z_[k] = r_[k] * scale;
  cholesky_.solve_single(z_, z_);
  for (double& z : z_) z *= largest;
}

bool RefinedCholesky::is_accurate() const {
  double residual = 0.0, length = 0.0;
  for (std::size_t k = 0; k < d_.size(); ++k) {
    residual = std::max(residual, std::abs(r_[k]) * inverse_d_[k]);
    length = std::max(length, std::abs(x_[k]) * d_[k]);
  }
  return residual <= kTolerance * (length + scaled_g_);
}

void RefinedCholesky::solve(std::span<const double> G, std::span<double> X, int columns) {
  require_double();
  cholesky_.solve(G, X, columns);
}

void RefinedCholesky::inverse_columns(std::span<const std::int64_t> scalars, std::span<double> X) {
  require_double();
  cholesky_.inverse_columns(scalars, X);
}

double RefinedCholesky::log_determinant() {
  require_double();
  return cholesky_.log_determinant();
}

std::string RefinedCholesky::description() const {
  if (precision_ == Precision::in_double) return {};
  std::string text = "mixed precision: " + std::to_string(solutions_) + " solutions refined in " +
                     std::to_string(steps_) + " steps";
  if (falls_back_) text += ", then double precision, since " + reason_;
  return text;
}

}  // namespace cairn::block
