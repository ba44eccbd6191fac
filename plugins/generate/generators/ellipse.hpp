// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// Whether the paper's lengths are half axes or whole ones.
enum class Axes { semi, whole };
constexpr auto enum_names(Axes) {
  return std::to_array<EnumName<Axes>>({{Axes::semi, "semi"}, {Axes::whole, "whole"}});
}

/// What `ellipse3d` and `ellipse_n` share.
struct EllipseOptions {
  Axes axes = Axes::semi;
  double height = 2.4;        ///< rise of the path above its lowest points [m]
  double loop_radius = 3.0;   ///< [m]
  double loop_angle = 0.2;    ///< [rad]
  double loop_density = 1.0;  ///< probability of a link within these
  Noise noise{.translation_sigma = 1e-3,
              .rotation_sigma = 1e-3,
              .translation_share = 0.05,
              .rotation_share = 0.05};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = EllipseOptions;
    return OptionFields<O>()
        .choice("axes", &O::axes, "whether the paper's lengths are half axes or whole ones")
        .real("height", &O::height, 0.0, 1e6, "rise of the path above its lowest points [m]")
        .real("loop_radius", &O::loop_radius, 1e-3, 1e4, "poses nearer than this are linked [m]")
        .real("loop_angle", &O::loop_angle, 0.0, 3.15,
              "if their orientations differ less than this [rad]")
        .real("loop_density", &O::loop_density, 0.0, 1.0, "probability of such a link")
        .part(&O::noise, Noise::fields_with_shares())
        .integer("outliers", &O::outliers, 0, 1e9, kOutlierHelp);
  }
};

/// Options of the generator `ellipse3d`.
struct Ellipse3dOptions {
  int poses = 170;
  EllipseOptions ellipse{};

  static auto fields() {
    using O = Ellipse3dOptions;
    return OptionFields<O>()
        .integer("poses", &O::poses, 3, 1e7, "number of poses")
        .part(&O::ellipse);
  }
};

/// Options of the generator `ellipse_n`.
struct EllipseNOptions {
  std::int64_t laps = 10;  ///< times around
  std::int64_t poses_per_lap = 106;
  EllipseOptions ellipse{};

  static auto fields() {
    using O = EllipseNOptions;
    return OptionFields<O>()
        .integer("laps", &O::laps, 1, 100000, "times around")
        .integer("poses_per_lap", &O::poses_per_lap, 3, 100000,
                 "poses per lap, at equal steps along it")
        .part(&O::ellipse);
  }
};

std::unique_ptr<Generator> make_ellipse3d(const Ellipse3dOptions& options);
std::unique_ptr<Generator> make_ellipse_n(const EllipseNOptions& options);

}  // namespace cairn::generate
