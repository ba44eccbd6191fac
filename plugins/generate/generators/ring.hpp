// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// Options of the generator `ring`.
struct RingOptions {
  std::int64_t poses = 434;
  double laps = 1.06;         ///< times around
  double step = 1.0;          ///< [m]
  double loop_radius = 0.8;   ///< [m]
  double loop_density = 1.0;  ///< probability that a place within reach is recognised
  int loops_per_pose = 1;     ///< at most
  Noise noise{.translation_sigma = 0.05, .rotation_sigma = 0.01};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = RingOptions;
    return OptionFields<O>()
        .integer("poses", &O::poses, 3, 1e8, "number of poses")
        .real("laps", &O::laps, 0.01, 1e6, "times around")
        .real("step", &O::step, 1e-3, 1e3, "distance between poses [m]")
        .real("loop_radius", &O::loop_radius, 1e-3, 1e4,
              "loops are closed with places nearer than this [m]")
        .real("loop_density", &O::loop_density, 0.0, 1.0,
              "probability that a place within reach is recognised")
        .integer("loops_per_pose", &O::loops_per_pose, 0, 1000,
                 "maximum number of loops that a pose closes")
        .part(&O::noise)
        .integer("outliers", &O::outliers, 0, 1e9, kOutlierHelp);
  }
};

std::unique_ptr<Generator> make_ring(const RingOptions& options);

}  // namespace cairn::generate
