// SPDX-License-Identifier: BSD-3-Clause
#include "consistency.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <boost/math/distributions/chi_squared.hpp>

namespace cairn::compact {

bool Gate::passes(double innovation, int dof) const {
  if (!std::isfinite(innovation)) return false;
  if (!on() || dof == 0) return true;
  return innovation < boost::math::quantile(boost::math::chi_squared(dof), part);
}

ConsistencyCheck::ConsistencyCheck(const RigidGroup& group, const SensorRange& range, Gate gate,
                                   double trust)
    : group_(&group), trust_(trust) {
  if (!gate.on()) return;
  const int n = group.tangent_size();
  limit_ = boost::math::quantile(boost::math::chi_squared(n), gate.part);
  // Of an ellipsoid {e : eᵀ S⁻¹ e < q}: π^{n/2} / Γ(n/2 + 1) · q^{n/2} |S|^{½}.
  log_volume_ = 0.5 * n * std::log(std::numbers::pi * limit_) - std::lgamma(0.5 * n + 1.0);
  for (int r = 0; r < group.dimension(); ++r) log_volume_ -= std::log(2.0 * range.translation[r]);
  const int rotations = n - group.dimension();
  log_volume_ -= rotations * std::log(2.0 * std::min(range.rotation, std::numbers::pi));
}

Fit ConsistencyCheck::judge(const Vector& e, const Matrix& S) const {
  Fit fit;
  const Eigen::LLT<Matrix> factor(S);
  fit.innovation = e.dot(factor.solve(e));
  fit.consistent = std::isfinite(fit.innovation);  // else numbers overflow
  if (!on()) return fit;
  fit.consistent = fit.innovation < limit_;
  const double log_root = factor.matrixLLT().diagonal().array().log().sum();  // ½ ln|S|
  fit.chance = std::min(1.0, std::exp(log_volume_ + log_root));
  return fit;
}

Fit ConsistencyCheck::fit(const Link& link, const Displacement& expected) const {
  const Vector e = group_->log(group_->between(expected.mean, link.mean));
  return judge(e, loose_ * expected.covariance + link.covariance);
}

double ConsistencyCheck::loosen_for(const Link& link, const Displacement& expected) {
  constexpr double kMost = 1e6;
  const double before = loose_;
  while (loose_ < kMost && !fit(link, expected).consistent) loose_ *= 2.0;
  if (!fit(link, expected).consistent) loose_ = before;
  return loose_;
}

/// With u = x_i⁻¹x_k and w = x_n⁻¹x_m between the ends of the links (i, n) and (k, m), the cycle
/// z_b⁻¹ u⁻¹ z_a w is the identity. Every part is perturbed on its right; what stands to the left
/// of a motion y is carried to its other side by Ad(y⁻¹).
Fit ConsistencyCheck::agreement(const Link& first, const Link& second, const Displacement& earlier,
                                const Displacement& later) const {
  const State identity = group_->between(first.mean, first.mean);
  const State u_back = group_->between(earlier.mean, identity),
              b_back = group_->between(second.mean, identity);
  const State to_start = group_->compose(b_back, u_back);
  const State cycle = group_->compose(group_->compose(to_start, first.mean), later.mean);
  const auto carried = [&](const Matrix& S, const State& by) -> Matrix {
    const Matrix A = group_->adjoint(group_->inverse(by));
    return A * S * A.transpose();
  };
  Matrix S = carried(second.covariance, b_back);
  S += earlier.covariance;
  S = carried(S, u_back);
  S = carried(S, first.mean) + first.covariance;
  S = carried(S, later.mean) + later.covariance;
  return judge(group_->log(cycle), S);
}

}  // namespace cairn::compact
