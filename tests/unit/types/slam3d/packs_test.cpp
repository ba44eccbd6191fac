// SPDX-License-Identifier: BSD-3-Clause
#include "../packs.hpp"

#include <gtest/gtest.h>

#include "slam3d/direction.hpp"
#include "slam3d/landmark.hpp"
#include "slam3d/orientation.hpp"
#include "slam3d/position.hpp"
#include "slam3d/priors.hpp"
#include "slam3d/relative_pose.hpp"

namespace cairn::test {
namespace {

template <class Metric>
void expect_equal_bits_in_metric() {
  expect_equal_bits<slam3d::RelativePose<Metric>>();
  expect_equal_bits<slam3d::PosePrior<Metric>>();
  expect_equal_bits<slam3d::Orientation<Metric>>();
}

TEST(Packs, GiveTheSameAsOneFactorAtATimeInSpace) {
  expect_equal_bits_in_metric<slam3d::Logarithm>();
  expect_equal_bits_in_metric<slam3d::QuaternionVector>();
  expect_equal_bits_in_metric<slam3d::TranslationAndRotationVector>();
  expect_equal_bits<slam3d::Landmark>();
  expect_equal_bits<slam3d::LandmarkPrior>();
  expect_equal_bits<slam3d::Position>();
  expect_equal_bits<slam3d::Direction>();
}

}  // namespace
}  // namespace cairn::test
