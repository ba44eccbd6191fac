// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/policy/registration.hpp"
#include "rigid_motions.hpp"

namespace cairn::registration {

struct RecordedOptions {
  int carry = 10;  ///< poses over which odometry carries a loop closure; 0: none is carried
  double false_rate = 0.0;  ///< part of the pairs that match whose motion is replaced
  std::uint64_t seed = 1;

  static auto fields() {
    using O = RecordedOptions;
    return OptionFields<O>()
        .integer("carry", &O::carry, 0, 1000000,
                 "a loop closure of a pose that was not kept is carried over to one that was, by "
                 "the odometry of at most so many poses; 0: it is lost")
        .real("false_rate", &O::false_rate, 0.0, 1.0,
              "fraction of the matching pairs whose measurement is replaced by a random relative "
              "pose")
        .integer("seed", &O::seed, 0, 1e15, "of the choice of pairs and of relative poses");
  }
};

std::unique_ptr<Registration> make_recorded(const RecordedOptions& options);

/// No angle between two orientations is larger; a little more than π, so that none is as large.
inline constexpr double kAnyAngle = 3.1416;

/// What a simulated sensor can do, and how often it cannot.
struct SimulatedOptions {
  Extent range{.length = 2.0, .angle = kAnyAngle};  ///< poses nearer than this can be matched
  double sigma_translation = 0.0;                   ///< [m]; 0: as in the recording
  double sigma_rotation = 0.0;                      ///< [rad]; 0: as in the recording
  double failure_rate = 0.0;  ///< of the pairs within range, those that are not matched
  double false_rate = 0.0;    ///< of the pairs matched within range, those with another motion
  double far_rate = 0.0;      ///< of the pairs out of range, those that are matched, falsely
  std::uint64_t seed = 1;

  static auto fields() {
    using O = SimulatedOptions;
    return OptionFields<O>()
        .part(&O::range,
              OptionFields<Extent>()
                  .real("range", &Extent::length, 1e-3, 1e6,
                        "poses nearer to each other than this can be matched [m]")
                  .real("angle", &Extent::angle, 1e-3, kAnyAngle,
                        "if their orientations differ by less than this [rad]; 3.1416: any"))
        .real("sigma_translation", &O::sigma_translation, 0.0, 1e6,
              "noise of measured translations, each axis [m]; 0: as in the recording")
        .real("sigma_rotation", &O::sigma_rotation, 0.0, 3.0,
              "noise of measured rotations, each axis [rad]; 0: as in the recording")
        .real("failure_rate", &O::failure_rate, 0.0, 1.0,
              "fraction of the pairs within range that are not matched")
        .real("false_rate", &O::false_rate, 0.0, 1.0,
              "fraction of the pairs matched within range with a random relative pose within range")
        .real("far_rate", &O::far_rate, 0.0, 1.0,
              "fraction of the pairs out of range that are matched, with a random relative pose")
        .integer("seed", &O::seed, 0, 1e15, "of noise, failures and false matches");
  }
};

std::unique_ptr<Registration> make_simulated(const SimulatedOptions& options);

}  // namespace cairn::registration
