// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// Options of the generator `grid3d`.
struct Grid3dOptions {
  int nx = 10, ny = 10, nz = 10;  ///< nodes along each axis
  double spacing = 1.0;           ///< of nodes [m]
  double loop_density = 0.9;      ///< probability that a visited neighbour is seen
  Noise noise{.translation_sigma = 0.05, .rotation_sigma = 0.02};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = Grid3dOptions;
    return OptionFields<O>()
        .integer("nx", &O::nx, 2, 1000, "nodes along x")
        .integer("ny", &O::ny, 2, 1000, "nodes along y")
        .integer("nz", &O::nz, 2, 1000, "nodes along z")
        .real("spacing", &O::spacing, 1e-3, 1e3, "distance between nodes [m]")
        .real("loop_density", &O::loop_density, 0.0, 1.0,
              "probability that a visited neighbour is seen")
        .part(&O::noise)
        .integer("outliers", &O::outliers, 0, 1e9, kOutlierHelp);
  }
};

std::unique_ptr<Generator> make_grid3d(const Grid3dOptions& options);

}  // namespace cairn::generate
