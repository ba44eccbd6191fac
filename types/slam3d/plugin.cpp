// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/plugin/registry.hpp"
#include "landmark.hpp"
#include "priors.hpp"
#include "relative_pose.hpp"

namespace {

using namespace cairn;

template <class Metric>
TypeSet types() {
  return {{define_variable<Se3>(), define_variable<PointXYZ>()},
          {define_factor<slam3d::RelativePose<Metric>>(), define_factor<slam3d::Landmark>(),
           define_factor<slam3d::PosePrior<Metric>>(), define_factor<slam3d::LandmarkPrior>()}};
}

TypeSet types_of(const Options& options) {
  const std::string& metric = options.text("metric");
  if (metric == slam3d::QuaternionVector::kName) return types<slam3d::QuaternionVector>();
  if (metric == slam3d::TranslationAndRotationVector::kName) {
    return types<slam3d::TranslationAndRotationVector>();
  }
  return types<slam3d::Logarithm>();
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add_types(
      "slam3d",
      OptionTable{}.choice(
          "metric", "logarithm", {"logarithm", "g2o", "rotation_vector"},
          "error of pose measurements: logarithm of the group; g2o: translation and "
          "vector part of the quaternion; translation and rotation vector"),
      types_of);
}
