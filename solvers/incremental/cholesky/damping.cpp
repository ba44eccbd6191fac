// SPDX-License-Identifier: BSD-3-Clause
#include "damping.hpp"

#include <algorithm>

namespace cairn::incremental {
namespace {

constexpr double kFirstDamping = 1e-6;
constexpr double kMostDamping = 1e12;
constexpr double kEase = 0.1;  ///< factor of λ after a step that is accepted
/// Once a step lowers chi2 by less than this fraction, H is not damped.
constexpr double kUndamped = 1e-3;
/// Once an undamped one does by less than this, that is the minimum.
constexpr double kConverged = 1e-6;

}  // namespace

void Damping::begin() {
  stage_ = Stage::begun;
  lambda_ = kFirstDamping;
}

void Damping::reject() {
  undamped_fails_ = undamped_fails_ || lambda_ == 0.0;
  lambda_ = std::max(lambda_, kFirstDamping) * growth_;
  growth_ *= 2.0;
  if (lambda_ > kMostDamping) end(false);
}

void Damping::accept(double gain, double chi2, double rounding) {
  growth_ = 2.0;
  const bool judges = lambda_ == 0.0 || undamped_fails_;
  if (judges && gain <= kConverged * chi2 + rounding) {
    end(true);
  } else if (!undamped_fails_ && gain <= kUndamped * chi2) {
    lambda_ = 0.0;
  } else {
    lambda_ *= kEase;
  }
}

}  // namespace cairn::incremental
