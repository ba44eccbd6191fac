// SPDX-License-Identifier: BSD-3-Clause
#include "damping.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn {
namespace {

/// A gain ratio this close to 1 shows that damping is not what the step needs.
constexpr double kAsPredicted = 0.06;
/// The least factor of λ after one step.
constexpr double kLeastFactor = 1e-6;
/// λ after the first failure.
constexpr double kModest = 1e-6;

}  // namespace

void Damping::ease(double gain_ratio) {
  const double x = 2.0 * gain_ratio - 1.0;
  const double factor = std::max(1.0 / 3.0, 1.0 - x * x * x);
  if (hopeful_ && std::abs(gain_ratio - 1.0) < kAsPredicted) {
    lambda_ *= std::max(std::pow(factor, ease_), kLeastFactor);
    ease_ = std::min(2.0 * ease_, 1e3);
  } else {
    lambda_ *= factor;
    ease_ = 1.0;
  }
  lambda_ = std::clamp(lambda_, smallest_, largest_);
  growth_ = 2.0;
}

void Damping::raise() {
  ease_ = 1.0;
  if (std::exchange(never_failed_, false) && hopeful_ && lambda_ < kModest) {
    lambda_ = std::min(kModest, largest_);
    return;
  }
  lambda_ = std::clamp(lambda_ * growth_, smallest_, largest_);
  growth_ *= 2.0;
}

void Damping::set(double lambda) { lambda_ = std::clamp(lambda, smallest_, largest_); }

void Endgame::consider(double gain) {
  if (wait_ > 0) {
    --wait_;
  } else if (gain <= gain_) {
    active_ = true;
  }
}

void Endgame::fail() {
  active_ = false;
  wait_ = 2 << std::min(failures_++, 10);
}

}  // namespace cairn
