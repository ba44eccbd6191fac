// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <vector>

namespace cairn {

class Descent;

/// A step s, and the change y = g − g₊ of the gradient that it made.
struct SecantPair {
  std::vector<double> s, y;
  double curvature = 0.0;  ///< sᵀy
};

/// Steps that also use what the last ones have shown of the curvature, where a run converges
/// slowly; nothing at all, to the last bit, where it does not.
///
/// H lacks the second derivatives of the residuals. Where residuals are large at the minimum, as
/// beside false loop closures, a Gauss-Newton step leaves a share of the error, or goes too far by
/// one, and the run converges linearly: hundreds of steps in graphs of a few poses. But the last
/// steps s and the changes of the gradient y = g − g₊ that they made show what is missing, and the
/// BFGS update (Nocedal and Wright 2006, eq. 6.17) of what was factorised, H or H + λD, has it:
/// A s = y. It is applied by the recursion of L-BFGS (Nocedal 1980), for one more solution with the
/// present factor and some scalar products.
///
/// A step of that kind is taken only if it lowers chi2. Pairs are remembered only once several
/// steps in a row have lowered chi2 by little: by then steps are short, and the tangent spaces of
/// one estimate and the next count as one. Not where something is free, as the gauge of cameras and
/// points is: there what is slow is the way of points to infinity, which no curvature shows.
class Acceleration {
 public:
  /// Computes the step from the present linearisation, if there is to be one. To be called with
  /// what is factorised now.
  void aim(Descent& run);
  /// gᵀd of that step d: what chi2 is likely to fall by.
  double decrement() const { return decrement_; }
  /// Whether convergence may be claimed, as far as that is known here: after a step of this kind
  /// the predicted decrease of the next one must be as small as Gauss-Newton's.
  bool may_end(const Descent& run) const;
  /// Puts that step in place of `run.step`, and the states that it leads to in `run.trial`, if chi2
  /// is lower there; returns chi2. Otherwise nothing, and `run.step` is as it was.
  std::optional<double> take(Descent& run);
  /// To be called where `run.step` is taken, before its end is linearised.
  void follow(const Descent& run);

 private:
  void look_back(const Descent& run);

  std::deque<SecantPair> pairs_;     // the newest first
  std::optional<SecantPair> begun_;  // by the last step; y holds the gradient before it
  std::optional<double> chi2_before_;
  std::vector<double> step_;
  double decrement_ = 0.0;  // 0: there is no step
  bool takes_ = false;      // such a step
  bool has_taken_ = false;  // the last one was such
  int little_ = 0;          // steps in a row that lowered chi2 by little
};

}  // namespace cairn
