// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// Options of the generator `manhattan`.
struct ManhattanOptions {
  std::int64_t poses = 3500;
  double step = 1.0;          ///< [m]
  int block = 4;              ///< steps between two crossings
  int streets = 0;            ///< each way; 0: as many as fit the poses
  double loop_radius = 1.5;   ///< [m]
  double loop_density = 0.2;  ///< probability that a place within reach is recognised
  int loops_per_pose = 3;     ///< at most
  Noise noise{.translation_sigma = 0.02, .rotation_sigma = 0.02};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = ManhattanOptions;
    return OptionFields<O>()
        .integer("poses", &O::poses, 2, 1e8, "number of poses")
        .real("step", &O::step, 1e-3, 1e3, "distance between poses [m]")
        .integer("block", &O::block, 1, 10000, "steps between two crossings")
        .integer("streets", &O::streets, 0, 100000,
                 "streets in each direction; 0: as many as fit the poses")
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

std::unique_ptr<Generator> make_manhattan(const ManhattanOptions& options);

}  // namespace cairn::generate
