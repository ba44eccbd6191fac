// SPDX-License-Identifier: BSD-3-Clause
#include "unit/types/analytic.hpp"

#include <gtest/gtest.h>

#include "slam3d/direction.hpp"
#include "slam3d/landmark.hpp"
#include "slam3d/metrics.hpp"
#include "slam3d/orientation.hpp"
#include "slam3d/position.hpp"
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

TEST(AnalyticJacobian, OfAPositionOrADirectionIsTheAutomaticOne) {
  Sampler sampler(43);
  for (const Regime& regime : regimes()) {
    SCOPED_TRACE(regime.name);
    for (int k = 0; k < 20; ++k) {
      const auto x = sample<Se3>(sampler, regime);
      expect_agreement<slam3d::Position>(sample<PointXYZ>(sampler, kAny), x);
      Vector<double, 6> z;
      z << sample<PointXYZ>(sampler, kAny), sample<PointXYZ>(sampler, kAny);
      ASSERT_EQ(slam3d::Direction::normalize(z), "");
      expect_agreement<slam3d::Direction>(z, x);
    }
  }
}

/// Where the error turns by the angle of each regime.
template <class Metric>
void check_orientation() {
  Sampler sampler(47);
  for (const Regime& regime : regimes()) {
    SCOPED_TRACE(regime.name);
    for (int k = 0; k < 20; ++k) {
      const auto known = sample<Se3>(sampler, kAny);
      const auto x = Se3::compose<double>(known, sample<Se3>(sampler, regime));
      expect_agreement<slam3d::Orientation<Metric>>(
          Vector<double, 4>(known[6], known[3], known[4], known[5]), x);
    }
  }
}
TEST(AnalyticJacobian, OfAnOrientationIsTheAutomaticOneInEachMetric) {
  check_orientation<slam3d::Logarithm>();
  check_orientation<slam3d::QuaternionVector>();
  check_orientation<slam3d::TranslationAndRotationVector>();
}

/// From the identity, so that rounding does not choose between the two logarithms.
template <class Metric>
void check_half_turns() {
  const Vector<double, 7> none = Se3::identity();
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0, 1),
        Eigen::Vector3d(0.6, 0, -0.8), Eigen::Vector3d(2.0 / 3, -1.0 / 3, 2.0 / 3)}) {
    Vector<double, 7> x;
    x << 1.0, -2.0, 3.0, axis, 0.0;
    expect_agreement<slam3d::RelativePose<Metric>>(none, none, x);
    expect_agreement<slam3d::RelativePose<Metric>>(x, none, x);
    expect_agreement<slam3d::PosePrior<Metric>>(none, x);
    expect_agreement<slam3d::PosePrior<Metric>>(x, x);
  }
}

TEST(AnalyticJacobian, OfHalfATurnIsTheAutomaticOneInEachMetric) {
  check_half_turns<slam3d::Logarithm>();
  check_half_turns<slam3d::QuaternionVector>();
  check_half_turns<slam3d::TranslationAndRotationVector>();
}

}  // namespace
}  // namespace cairn::test
