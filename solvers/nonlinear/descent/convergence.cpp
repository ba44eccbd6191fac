// SPDX-License-Identifier: BSD-3-Clause
#include "convergence.hpp"

#include <algorithm>

namespace cairn {
namespace {

/// Slowest geometric rate that is believed: the rounding of a promise near zero looks like no
/// progress at all.
constexpr double kSlowestRate = 0.999;

}  // namespace

bool Convergence::arrived(double promise, double chi2) {
  const double rate =
      last_promise_ > 0.0 ? std::clamp(promise / last_promise_, 0.0, kSlowestRate) : 0.0;
  last_promise_ = promise;
  return tolerance_ > 0.0 && promise <= (1.0 - rate) * tolerance_ * chi2;
}

bool Convergence::exhausted(bool lowered, double step_norm, double extent) {
  const bool futile = !lowered && negligible(step_norm, extent);
  futile_ = futile ? futile_ + 1 : 0;
  return tolerance_ > 0.0 && futile_ >= 2;
}

}  // namespace cairn
