// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "direction.hpp"
#include "landmark.hpp"
#include "orientation.hpp"
#include "position.hpp"
#include "priors.hpp"
#include "relative_point.hpp"
#include "relative_pose.hpp"
#include "slam3d_options.hpp"

namespace {

using namespace cairn;

template <class Metric>
TypeSet types() {
  return {{define_variable<Se3>(), define_variable<PointXYZ>()},
          {define_factor<slam3d::RelativePose<Metric>>(), define_factor<slam3d::Landmark>(),
           define_factor<slam3d::PosePrior<Metric>>(), define_factor<slam3d::LandmarkPrior>(),
           define_factor<slam3d::RelativePoint>(), define_factor<slam3d::Position>(),
           define_factor<slam3d::Orientation<Metric>>(), define_factor<slam3d::Direction>()}};
}

TypeSet types_of(const slam3d::Slam3dOptions& options) {
  switch (options.metric) {
    case slam3d::Metric::logarithm:
      return types<slam3d::Logarithm>();
    case slam3d::Metric::quaternion_vector:
      return types<slam3d::QuaternionVector>();
    case slam3d::Metric::translation_and_rotation_vector:
      break;
  }
  return types<slam3d::TranslationAndRotationVector>();
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add_types<slam3d::Slam3dOptions>("slam3d", types_of);
}
