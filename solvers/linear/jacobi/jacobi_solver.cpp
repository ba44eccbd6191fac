// SPDX-License-Identifier: BSD-3-Clause
#include "jacobi_solver.hpp"

#include <cmath>
#include <cstdint>

#include <fmt/core.h>

#include "cairn/runtime/threads.hpp"

namespace cairn {
namespace {

constexpr int kPowerIterations = 30;
/// Of the 2/λ at which Jacobi stops to converge; the rest makes up for a λ that is too low.
constexpr double kShareOfLimit = 0.9;

/// Reproducible numbers in [-1, 1): a start that no structure is orthogonal to.
class Noise {
 public:
  double operator()() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11) * 0x1p-52 - 1.0;
  }

 private:
  std::uint64_t state_ = 1;
};

}  // namespace

JacobiSolver::JacobiSolver(const JacobiOptions& options)
    : Relaxation("jacobi", options.relaxation), given_(options.omega), omega_(options.omega) {}

/// The Rayleigh quotient of D⁻¹H in the inner product of H, in which it is symmetric.
double JacobiSolver::largest_eigenvalue() {
  Noise noise;
  v_.resize(residual().size());
  for (double& v : v_) v = noise();
  double lambda = 0.0;
  for (int k = 0; k < kPowerIterations; ++k) {
    const double length = H().multiply_dot(v_, residual());
    const double stretched = diagonal().solve(residual(), z_);
    if (!(length > 0.0) || !(stretched > 0.0)) break;  // H is not positive definite: solves tell
    lambda = stretched / length;
    const double scale = 1.0 / std::sqrt(stretched);
    for (std::size_t i = 0; i < v_.size(); ++i) v_[i] = scale * z_[i];
  }
  return lambda;
}

void JacobiSolver::prepare() {
  z_.resize(residual().size());
  if (given_ > 0.0) return;
  const double lambda = largest_eigenvalue();
  omega_ = lambda > 0.0 ? 2.0 * kShareOfLimit / lambda : 0.5;
}

bool JacobiSolver::damp_more() {
  if (given_ > 0.0 || omega_ < 1e-3) return false;
  omega_ *= 0.5;
  return true;
}

void JacobiSolver::sweep(std::span<const double> g, std::span<double> x) {
  const std::span<double> r = residual();
  H().multiply(x, r);
  for_each_range(r.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) r[k] = g[k] - r[k];
  });
  diagonal().solve(r, z_);
  for_each_range(r.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) x[k] += omega_ * z_[k];
  });
}

std::string JacobiSolver::note() const {
  return omega_ > 0.0 ? fmt::format("block Jacobi, omega {:.3g}", omega_) : "block Jacobi";
}

}  // namespace cairn
