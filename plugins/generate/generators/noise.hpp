// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/option_fields.hpp"

namespace cairn::generate {

/// How a relative measurement errs. Its standard deviations are, on each axis,
///   translation: sqrt(sigma² + (share · length of the motion)²) [m],
///   rotation:    sqrt(sigma² + (share · angle of the motion)²)  [rad],
/// times `scale`, and for loop closures times `loops`. With scale 0 measurements are exact and the
/// information is that of scale 1.
struct Noise {
  double translation_sigma = 0.0;  ///< [m]
  double rotation_sigma = 0.0;     ///< [rad]
  double translation_share = 0.0;
  double rotation_share = 0.0;
  double scale = 1.0;
  double loops = 1.0;

  /// Options translation_sigma, rotation_sigma and noise, for worlds without loop closures between
  /// poses.
  static auto odometry_fields() { return add_scale(sigmas()); }
  /// The same, and loop_noise.
  static auto fields() { return add_loops(odometry_fields()); }
  /// The same, and translation_error and rotation_error.
  static auto fields_with_shares() {
    return add_loops(
        add_scale(sigmas()
                      .real("translation_error", &Noise::translation_share, 0.0, 10.0,
                            "further noise as a fraction of the length of the relative pose")
                      .real("rotation_error", &Noise::rotation_share, 0.0, 10.0,
                            "further noise as a fraction of its angle")));
  }

 private:
  static OptionFields<Noise> sigmas() {
    return OptionFields<Noise>()
        .real("translation_sigma", &Noise::translation_sigma, 1e-9, 1e6,
              "noise of measured translations, each axis [m]")
        .real("rotation_sigma", &Noise::rotation_sigma, 1e-9, 3.0,
              "noise of measured rotations, each axis [rad]");
  }
  static OptionFields<Noise> add_scale(OptionFields<Noise> fields) {
    return fields.real("noise", &Noise::scale, 0.0, 1000.0,
                       "factor on all noise; 0: exact measurements, weighted as for 1");
  }
  static OptionFields<Noise> add_loops(OptionFields<Noise> fields) {
    return fields.real("loop_noise", &Noise::loops, 1e-6, 1e6,
                       "noise of loop closures as a multiple of that of odometry");
  }
};

/// Help of the option outliers where these are loop closures.
inline constexpr const char* kOutlierHelp = "wrong loop closures, weighted like correct ones";

}  // namespace cairn::generate
