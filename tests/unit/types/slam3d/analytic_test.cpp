// SPDX-License-Identifier: BSD-3-Clause
#include "unit/types/analytic.hpp"

#include <gtest/gtest.h>

#include "slam3d/landmark.hpp"
#include "slam3d/metrics.hpp"
#include "slam3d/priors.hpp"
#include "slam3d/relative_pose.hpp"

namespace cairn::test {
namespace {

TEST(AnalyticJacobian, OfARelativePoseIsTheAutomaticOneInEachMetric) {
  check_relative<slam3d::RelativePose<slam3d::Logarithm>, Se3>();
  check_relative<slam3d::RelativePose<slam3d::QuaternionVector>, Se3>();
  check_relative<slam3d::RelativePose<slam3d::TranslationAndRotationVector>, Se3>();
}
TEST(AnalyticJacobian, OfALandmarkIsTheAutomaticOne) {
  check_landmark<slam3d::Landmark, Se3, PointXYZ>();
}
TEST(AnalyticJacobian, OfAPriorIsTheAutomaticOneInEachMetric) {
  check_prior<slam3d::PosePrior<slam3d::Logarithm>, Se3>();
  check_prior<slam3d::PosePrior<slam3d::QuaternionVector>, Se3>();
  check_prior<slam3d::PosePrior<slam3d::TranslationAndRotationVector>, Se3>();
  check_prior<slam3d::LandmarkPrior, PointXYZ>();
}

}  // namespace
}  // namespace cairn::test
