// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "cairn/plugin/option_fields.hpp"
#include "metrics.hpp"

namespace cairn::slam3d {

/// The error of pose measurements, by the classes of metrics.hpp.
enum class Metric { logarithm, quaternion_vector, translation_and_rotation_vector };
constexpr auto enum_names(Metric) {
  return std::to_array<EnumName<Metric>>(
      {{Metric::logarithm, Logarithm::kName},
       {Metric::quaternion_vector, QuaternionVector::kName},
       {Metric::translation_and_rotation_vector, TranslationAndRotationVector::kName}});
}

/// Options of the types `slam3d`. The default keeps the position apart from the rotation, so that a
/// component that is not measured changes nothing of the others, and has angles in radians.
struct Slam3dOptions {
  Metric metric = Metric::translation_and_rotation_vector;

  static auto fields() {
    return OptionFields<Slam3dOptions>().choice(
        "metric", &Slam3dOptions::metric,
        "error of pose measurements: translation and rotation vector; g2o: translation and "
        "vector part of the quaternion (half the angle); logarithm of the group");
  }
};

}  // namespace cairn::slam3d
