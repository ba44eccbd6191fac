// SPDX-License-Identifier: BSD-3-Clause
#include "../packs.hpp"

#include <gtest/gtest.h>

#include "slam2d/bearing_range.hpp"
#include "slam2d/landmark.hpp"
#include "slam2d/position.hpp"
#include "slam2d/priors.hpp"
#include "slam2d/relative_pose.hpp"

namespace cairn::test {
namespace {

TEST(Packs, GiveTheSameAsOneFactorAtATimeInThePlane) {
  expect_equal_bits<slam2d::RelativePose>();
  expect_equal_bits<slam2d::Landmark>();
  expect_equal_bits<slam2d::BearingRange>();
  expect_equal_bits<slam2d::PosePrior>();
  expect_equal_bits<slam2d::LandmarkPrior>();
  expect_equal_bits<slam2d::Position>();
}

}  // namespace
}  // namespace cairn::test
