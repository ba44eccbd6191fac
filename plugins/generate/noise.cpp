// SPDX-License-Identifier: BSD-3-Clause
#include "noise.hpp"

namespace cairn::generate {

void add_noise_options(OptionTable& table, const Noise& defaults, bool shares) {
  table
      .real("translation_sigma", defaults.translation_sigma, 1e-9, 1e6,
            "noise of measured translations, each axis [m]")
      .real("rotation_sigma", defaults.rotation_sigma, 1e-9, 3.0,
            "noise of measured rotations, each axis [rad]");
  if (shares) {
    table
        .real("translation_error", defaults.translation_share, 0.0, 10.0,
              "further noise as a fraction of the length of the relative pose")
        .real("rotation_error", defaults.rotation_share, 0.0, 10.0,
              "further noise as a fraction of its angle");
  }
  table.real("noise", defaults.scale, 0.0, 1000.0,
             "factor on all noise; 0: exact measurements, weighted as for 1");
}

Noise read_noise(const Options& options, bool shares) {
  Noise noise;
  noise.translation_sigma = options.real("translation_sigma");
  noise.rotation_sigma = options.real("rotation_sigma");
  if (shares) {
    noise.translation_share = options.real("translation_error");
    noise.rotation_share = options.real("rotation_error");
  }
  noise.scale = options.real("noise");
  return noise;
}

}  // namespace cairn::generate
