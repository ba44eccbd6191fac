// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn {

/// Decides when an optimisation has converged, from the predicted decreases of undamped steps.
///
/// The full Gauss-Newton step δ = H⁻¹g has the predicted decrease gᵀδ of chi2 (the Newton
/// decrement). Where the residuals at the minimum are large Gauss-Newton converges linearly, and
/// the predicted decreases form a geometric series p, qp, q²p, … whose sum p/(1−q) is the remaining
/// decrease. That sum, not its first member, is compared with the tolerance: so slow convergence is
/// not mistaken for convergence.
class Convergence {
 public:
  /// `tolerance`: fraction of chi2; 0 never converges.
  explicit Convergence(double tolerance) : tolerance_(tolerance) {}

  /// Whether the remaining decrease is below the tolerance. `promise`: gᵀδ of the undamped step at
  /// an estimate with that chi2; to be called once per linearisation.
  bool arrived(double promise, double chi2);

  /// Whether a step is below 1e-9 of the extent of the states (`Descent::state_extent`).
  static bool negligible(double step_norm, double extent) {
    return step_norm <= 1e-9 * (extent + 1e-9);
  }

  /// Whether arithmetic allows no further progress: to be called with each step; true when
  /// `lowered` has been false twice in a row for negligible steps. (chi2 = 0 is never
  /// reached to a relative tolerance.)
  bool exhausted(bool lowered, double step_norm, double extent);

 private:
  double tolerance_;
  double last_promise_ = 0.0;
  int futile_ = 0;
};

}  // namespace cairn
