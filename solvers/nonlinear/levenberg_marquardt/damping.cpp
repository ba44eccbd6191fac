// SPDX-License-Identifier: BSD-3-Clause
#include "damping.hpp"

#include <algorithm>

namespace cairn {

void Damping::ease(double gain_ratio) {
  const double x = 2.0 * gain_ratio - 1.0;
  lambda_ = std::clamp(lambda_ * std::max(1.0 / 3.0, 1.0 - x * x * x), smallest_, largest_);
  growth_ = 2.0;
}

void Damping::raise() {
  lambda_ = std::clamp(lambda_ * growth_, smallest_, largest_);
  growth_ *= 2.0;
}

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
