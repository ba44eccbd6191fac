// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

namespace cairn {

/// How much a Levenberg-Marquardt step is damped: H + λ D. λ follows the gain ratio ρ = (actual
/// decrease of chi2) / (predicted decrease) by the rule of Nielsen (1999): λ ← λ max(1/3, 1 − (2ρ −
/// 1)³) after a step that is taken, λ ← λν with ν = 2, 4, 8, … after steps that are not.
class Damping {
 public:
  Damping(double initial, double smallest, double largest)
      : lambda_(initial), smallest_(smallest), largest_(largest) {}

  double lambda() const { return lambda_; }
  bool at_limit() const { return lambda_ >= largest_; }
  void ease(double gain_ratio);
  void raise();

 private:
  double lambda_;
  double smallest_;
  double largest_;
  double growth_ = 2.0;
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
