// SPDX-License-Identifier: BSD-3-Clause
#include "unit/types/analytic.hpp"

#include <gtest/gtest.h>

#include "slam2d/bearing_range.hpp"
#include "slam2d/landmark.hpp"
#include "slam2d/position.hpp"
#include "slam2d/priors.hpp"
#include "slam2d/relative_pose.hpp"

namespace cairn::test {
namespace {

TEST(AnalyticJacobian, OfAPlanarRelativePoseIsTheAutomaticOne) {
  check_relative<slam2d::RelativePose, Se2>();
}
TEST(AnalyticJacobian, OfAPlanarLandmarkIsTheAutomaticOne) {
  check_landmark<slam2d::Landmark, Se2, PointXY>();
}
TEST(AnalyticJacobian, OfABearingAndRangeIsTheAutomaticOne) {
  check_landmark<slam2d::BearingRange, Se2, PointXY>();
}
TEST(AnalyticJacobian, OfAPlanarPriorIsTheAutomaticOne) {
  check_prior<slam2d::PosePrior, Se2>();
  check_prior<slam2d::LandmarkPrior, PointXY>();
}
TEST(AnalyticJacobian, OfAPlanarPositionIsTheAutomaticOne) {
  Sampler sampler(43);
  for (const Regime& regime : regimes())
    expect_agreement<slam2d::Position>(sample<PointXY>(sampler, kAny),
                                       sample<Se2>(sampler, regime));
}
}  // namespace
}  // namespace cairn::test
