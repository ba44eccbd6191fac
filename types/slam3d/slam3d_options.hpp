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

/// Options of the types `slam3d`.
struct Slam3dOptions {
  Metric metric = Metric::logarithm;

  static auto fields() {
    return OptionFields<Slam3dOptions>().choice(
        "metric", &Slam3dOptions::metric,
        "error of pose measurements: logarithm of the group; g2o: translation and "
        "vector part of the quaternion; translation and rotation vector");
  }
};

}  // namespace cairn::slam3d
