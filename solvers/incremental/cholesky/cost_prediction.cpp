// SPDX-License-Identifier: BSD-3-Clause
#include "cost_prediction.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::incremental {
namespace {

// How the accuracy that is asked for, a fraction of chi2, is shared out. Found by trying on the
// published graphs: what is left at the end stays well within it.
constexpr double kEnough = 0.08;    ///< of it all: by how much more solving could lower chi2
constexpr double kStepShare = 0.1;  ///< of a factor's: steps that are not followed down the tree
/// So much may be left of the steps since the factors were evaluated, before they are again.
constexpr double kLook = 0.15;
/// A step that has gained so many times what may be left is looked at in any case.
constexpr double kFar = 6.0;
/// What is left is guessed from what was: a share of what the steps have gained, at least …
constexpr double kLeastShare = 5e-3;
constexpr double kOthersShare = 0.05;   ///< … where factors are not of poses alone, …
constexpr double kForget = 0.5;         ///< … and not less than so much of the guess before, …
constexpr double kOthersForget = 0.95;  ///< … where they are not
/// What can still be gained is at most so many times what steps have fallen short of.
constexpr double kCaution = 6.0;
/// Gradients that promise up to so many times as much say that H is right.
constexpr double kTrusted = 3.0;
/// Where some factors are none of poses alone: while a solution leaves less than this fraction of
/// what it has gained, H does as it is.
constexpr double kFast = 0.2;
/// Jacobians of such factors that are off by more than this part are renewed.
constexpr double kMismatch = 0.05;

}  // namespace

double CostPrediction::cost(double evaluated) const { return std::max(evaluated - gained_, 0.0); }

double CostPrediction::negligible(double cost) const { return kEnough * accuracy_ * cost; }

double CostPrediction::tolerance(double cost, int factors) const {
  return kStepShare * accuracy_ * cost / std::max(factors, 1);
}

bool CostPrediction::is_sure(double cost) const {
  const double allowed = accuracy_ * cost;
  return left_share_ * gained_ <= kLook * allowed && decrease_ <= kFar * allowed;
}

void CostPrediction::begin_evaluation(double evaluated) {
  expected_ = cost(evaluated);
  looked_at_ = std::exchange(gained_, 0.0);
  square_ = 0.0;
  compared_ = 0;
}

void CostPrediction::note_mismatch(double mismatch) {
  square_ += mismatch * mismatch;
  ++compared_;
}

void CostPrediction::end_evaluation(double cost) {
  mismatch_ = compared_ > 0 ? std::sqrt(square_ / compared_) : 0.0;
  shortfall_ = cost - expected_;
}

CostPrediction::Judgement CostPrediction::judge(double left, double cost, double rounding,
                                                bool poses_alone) {
  left = std::min(left, cost);  // more is rounding: chi2 is not negative
  const double allowed = accuracy_ * cost + rounding;
  const double likely = poses_alone ? std::min(left, kCaution * std::abs(shortfall_)) : left;
  left_share_ = poses_alone ? std::max(kForget * left_share_, kLeastShare)
                            : std::max(kOthersForget * left_share_, kOthersShare);
  if (looked_at_ > 0.0) left_share_ = std::clamp(likely / looked_at_, left_share_, 1.0);
  const bool agree =
      poses_alone ? left <= std::min(kTrusted * likely, looked_at_) : left <= kFast * looked_at_;
  const bool match = mismatch_ <= kMismatch;
  return {.likely = likely,
          .is_enough = likely <= kEnough * allowed && match,
          .H_is_right = agree && match};
}

}  // namespace cairn::incremental
