// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

namespace cairn {

/// How much a Levenberg-Marquardt step is damped: H + λ D. λ follows the gain ratio ρ = (actual
/// decrease of chi2) / (predicted decrease) by the rule of Nielsen (1999): λ ← λ max(1/3, 1 − (2ρ −
/// 1)³) after a step that is taken, λ ← λν with ν = 2, 4, 8, … after steps that are not.
///
/// `hopeful` adds two things, which save iterations where H is regular without damping. While steps
/// in a row gain what was predicted (|ρ − 1| < 0.06), the factor is squared from one to the next,
/// so that a λ that was needed once is gone after a few. And λ may begin so small that a first step
/// is all but undamped: after the first step that is not taken it is at least 1e-6, instead of
/// climbing there by one failed step after the other.
class Damping {
 public:
  Damping(double initial, double smallest, double largest, bool hopeful)
      : lambda_(initial), smallest_(smallest), largest_(largest), hopeful_(hopeful) {}

  double lambda() const { return lambda_; }
  bool at_limit() const { return lambda_ >= largest_; }
  void ease(double gain_ratio);
  void raise();
  void set(double lambda);

 private:
  double lambda_;
  double smallest_;
  double largest_;
  bool hopeful_;
  double growth_ = 2.0;
  double ease_ = 1.0;  // power of the factor
  bool never_failed_ = true;
};

/// When to omit the damping. Close to the minimum damping only delays: weak modes, such as the far
/// end of a long chain, converge slowly as long as λ is above their eigenvalues, and a small
/// predicted decrease then means nothing. So once steps lower chi2 little, undamped Gauss-Newton
/// steps are tried; if one is rejected, damping returns, and the next trial waits twice as long.
class Endgame {
 public:
  /// `gain`: fraction of chi2 below which an accepted step counts as little; 0 for never.
  explicit Endgame(double gain) : gain_(gain) {}

  bool active() const { return active_; }
  /// Whether undamped steps have been tried and abandoned.
  bool ever_failed() const { return failures_ > 0; }
  /// To be called after each damped step that was taken, with the fraction of chi2 that it lowered.
  void consider(double gain);
  void fail();

 private:
  double gain_;
  bool active_ = false;
  int wait_ = 0;
  int failures_ = 0;
};

}  // namespace cairn
