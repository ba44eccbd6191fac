// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "noise.hpp"

namespace cairn::generate {

/// What is measured of a landmark.
enum class LandmarkSensor { cartesian, bearing_range };
constexpr auto enum_names(LandmarkSensor) {
  return std::to_array<EnumName<LandmarkSensor>>(
      {{LandmarkSensor::cartesian, "cartesian"}, {LandmarkSensor::bearing_range, "bearing_range"}});
}

/// Options of the generator `landmarks2d`.
struct Landmarks2dOptions {
  std::int64_t poses = 2000;
  double step = 1.0;               ///< [m]
  int block = 8;                   ///< steps between two crossings
  int streets = 0;                 ///< each way; 0: as many as fit the poses
  double landmark_density = 0.02;  ///< [1/m²]
  LandmarkSensor sensor = LandmarkSensor::cartesian;
  double sensor_range = 6.0;    ///< [m]
  double loop_density = 0.5;    ///< probability that a landmark within range is seen
  double landmark_sigma = 0.1;  ///< of a landmark's position, or of its range [m]
  double bearing_sigma = 0.02;  ///< [rad]
  Noise noise{.translation_sigma = 0.05, .rotation_sigma = 0.01};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = Landmarks2dOptions;
    return OptionFields<O>()
        .integer("poses", &O::poses, 2, 1e8, "number of poses")
        .real("step", &O::step, 1e-3, 1e3, "distance between poses [m]")
        .integer("block", &O::block, 1, 10000, "steps between two crossings")
        .integer("streets", &O::streets, 0, 100000,
                 "streets in each direction; 0: as many as fit the poses")
        .real("landmark_density", &O::landmark_density, 1e-9, 1e3, "landmarks per square metre")
        .choice("sensor", &O::sensor, "what is measured of a landmark")
        .real("sensor_range", &O::sensor_range, 1e-3, 1e4,
              "landmarks nearer than this are seen [m]")
        .real("loop_density", &O::loop_density, 0.0, 1.0,
              "probability that a landmark within range is seen")
        .real("landmark_sigma", &O::landmark_sigma, 1e-9, 1e6,
              "noise of a landmark's position, or of its range [m]")
        .real("bearing_sigma", &O::bearing_sigma, 1e-9, 3.0, "noise of a landmark's bearing [rad]")
        .part(&O::noise, Noise::odometry_fields())
        .integer("outliers", &O::outliers, 0, 1e9, "observations associated with a wrong landmark");
  }
};

std::unique_ptr<Generator> make_landmarks2d(const Landmarks2dOptions& options);

}  // namespace cairn::generate
