// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// Options of the generator `torus`.
struct TorusOptions {
  int turns = 100;  ///< around the tube
  int poses_per_turn = 50;
  double major_radius = 40.0;  ///< of the circle that the tube follows [m]
  double minor_radius = 15.0;  ///< of the tube [m]
  double loop_density = 0.8;   ///< probability that a pose sees that of the previous turn
  Noise noise{.translation_sigma = 0.1, .rotation_sigma = 0.02};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = TorusOptions;
    return OptionFields<O>()
        .integer("turns", &O::turns, 3, 100000, "turns around the tube")
        .integer("poses_per_turn", &O::poses_per_turn, 3, 100000, "poses per turn")
        .real("major_radius", &O::major_radius, 1e-3, 1e6,
              "radius of the circle that the tube follows [m]")
        .real("minor_radius", &O::minor_radius, 1e-3, 1e6, "radius of the tube [m]")
        .real("loop_density", &O::loop_density, 0.0, 1.0,
              "probability of a loop closure with the pose one turn earlier")
        .part(&O::noise)
        .integer("outliers", &O::outliers, 0, 1e9, kOutlierHelp);
  }
};

std::unique_ptr<Generator> make_torus(const TorusOptions& options);

}  // namespace cairn::generate
