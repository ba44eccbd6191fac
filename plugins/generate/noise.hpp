// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/options.hpp"

namespace cairn::generate {

/// How a relative measurement errs. Its standard deviations are, on each axis,
///   translation: sqrt(sigma² + (share · length of the motion)²) [m],
///   rotation:    sqrt(sigma² + (share · angle of the motion)²)  [rad],
/// times `scale`. With scale 0 measurements are exact and the information is that of scale 1.
struct Noise {
  double translation_sigma = 0.0;  ///< [m]
  double rotation_sigma = 0.0;     ///< [rad]
  double translation_share = 0.0;
  double rotation_share = 0.0;
  double scale = 1.0;
};

/// Options noise, translation_sigma, rotation_sigma (and with `shares` translation_error,
/// rotation_error).
void add_noise_options(OptionTable& table, const Noise& defaults, bool shares = false);
Noise read_noise(const Options& options, bool shares = false);

}  // namespace cairn::generate
