// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace cairn::incremental {

/// How the rounds of a solution are damped, H + λ diag(H), where Gauss-Newton does not do.
///
/// λ grows by 2, 4, 8, … times where steps are rejected in a row. Once they lower chi2 by little H
/// is not damped, which would only delay, unless that has failed before.
class Damping {
 public:
  enum class Stage : std::uint8_t {
    none,
    begun,  ///< everything is linearised where the last estimate that was accepted is
    tried,  ///< or after a step from there
    last    ///< it has converged, or never will: H as it is
  };
  Stage stage() const { return stage_; }
  double lambda() const { return lambda_; }
  /// Where the rounds have ended.
  bool has_converged() const { return converged_; }

  /// Everything is about to be linearised.
  void begin();
  void linearized_here() { stage_ = Stage::begun; }
  /// A step is to be taken.
  void take_step() { stage_ = Stage::tried; }
  /// A step has raised chi2, or cannot be computed.
  void reject();
  /// A step has lowered chi2 by `gain`; `rounding`: of that.
  void accept(double gain, double chi2, double rounding);
  void end(bool converged) {
    stage_ = Stage::last;
    lambda_ = 0.0;
    converged_ = converged;
  }

 private:
  Stage stage_ = Stage::none;
  double lambda_ = 0.0;
  bool converged_ = true;
  double growth_ = 2.0;          // of lambda, if the next step is rejected
  bool undamped_fails_ = false;  // has raised chi2 before
};

}  // namespace cairn::incremental
