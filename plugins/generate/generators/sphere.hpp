// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// Options of the generator `sphere`.
struct SphereOptions {
  int turns = 50;  ///< around the sphere
  int poses_per_turn = 50;
  double radius = 50.0;       ///< of the sphere [m]
  double loop_density = 1.0;  ///< probability that a pose sees that of the previous turn
  Noise noise{.translation_sigma = 0.1, .rotation_sigma = 0.02};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = SphereOptions;
    return OptionFields<O>()
        .integer("turns", &O::turns, 2, 100000, "turns around the sphere")
        .integer("poses_per_turn", &O::poses_per_turn, 3, 100000, "poses per turn")
        .real("radius", &O::radius, 1e-3, 1e6, "radius of the sphere [m]")
        .real("loop_density", &O::loop_density, 0.0, 1.0,
              "probability of a loop closure with the pose one turn earlier")
        .part(&O::noise)
        .integer("outliers", &O::outliers, 0, 1e9, kOutlierHelp);
  }
};

std::unique_ptr<Generator> make_sphere(const SphereOptions& options);

}  // namespace cairn::generate
