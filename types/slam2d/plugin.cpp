// SPDX-License-Identifier: BSD-3-Clause
#include "bearing_range.hpp"
#include "cairn/plugin/registry.hpp"
#include "landmark.hpp"
#include "position.hpp"
#include "priors.hpp"
#include "relative_point.hpp"
#include "relative_pose.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add_types("slam2d", OptionTable{}, [](const Options&) {
    return TypeSet{{define_variable<Se2>(), define_variable<PointXY>()},
                   {define_factor<slam2d::RelativePose>(), define_factor<slam2d::Landmark>(),
                    define_factor_with_domain<slam2d::BearingRange>(),
                    define_factor<slam2d::PosePrior>(), define_factor<slam2d::LandmarkPrior>(),
                    define_factor<slam2d::RelativePoint>(), define_factor<slam2d::Position>()}};
  });
}
