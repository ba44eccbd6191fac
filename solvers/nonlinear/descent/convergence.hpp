// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn {

/// Decides when an optimisation has arrived, from what undamped steps promise.
///
/// The full Gauss-Newton step δ = H⁻¹g promises to lower chi2 by gᵀδ (the Newton decrement). Where
/// the residuals at the minimum are large Gauss-Newton converges linearly, and the promises form a
/// geometric series p, qp, q²p, … whose sum p/(1−q) is what is left to gain. That sum, not its
/// first member, is compared with the tolerance: so a run that creeps is not taken for one that has
/// arrived.
class Convergence {
 public:
  /// `tolerance`: fraction of chi2; 0 never converges. `state_norm`: Euclidean norm of all states.
  Convergence(double tolerance, double state_norm)
      : tolerance_(tolerance), state_norm_(state_norm) {}

  /// Whether what is left to gain is below the tolerance. `promise`: gᵀδ of the undamped step at an
  /// estimate with that chi2; to be called once a linearisation.
  bool arrived(double promise, double chi2);

  /// Whether arithmetic allows no further progress: to be called with each step; true when
  /// `lowered` has been false twice in a row for steps below 1e-9 of the states. (chi2 = 0 is never
  /// reached to a relative tolerance.)
  bool exhausted(bool lowered, double step_norm);

 private:
  double tolerance_;
  double state_norm_;
  double last_promise_ = 0.0;
  int futile_ = 0;
};

}  // namespace cairn
