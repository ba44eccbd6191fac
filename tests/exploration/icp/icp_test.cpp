// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/geometry/motion.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/error.hpp"
#include "generated_floors.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// Two poses in a room, and a registration that has their scans.
class IcpTest : public testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("types", "slam2d");
    registration_ = registry_.make<Registration>("icp");
    registration_->begin({});
    auto* scans = query<ScanRegistration>(*registration_);
    ASSERT_NE(scans, nullptr);
    scans->take(7, room_.scan(first_));
    scans->take(3, room_.scan(first_ * truth_));
  }

  Motion expected(const Pose2& mean, double sigma, double sigma_angle) const {
    Motion motion{{mean.x(), mean.y(), mean.theta()}, std::vector<double>(9, 0.0)};
    motion.covariance[0] = motion.covariance[4] = sigma * sigma;
    motion.covariance[8] = sigma_angle * sigma_angle;
    return motion;
  }
  /// The measured relative pose from 7 to 3.
  void expect_truth(const std::vector<Factor>& factors) {
    ASSERT_THAT(factors, SizeIs(1));
    EXPECT_EQ(factors[0].type->tag(), "EDGE_SE2");
    const MotionGroup group(registry_.variable_type("VERTEX_SE2"));
    const Motion measured = group.of_factor(factors[0], 7);
    EXPECT_TRUE(Pose2::from_state(measured.mean).equals(truth_, 0.005));
    EXPECT_LT(measured.covariance[0], 0.01);
  }

  Registry registry_;
  const test::Walls room_ = test::furnished_room();
  const Pose2 first_{1.5, 1.8, 0.2}, truth_{0.6, 0.3, 0.3};
  std::unique_ptr<Registration> registration_;
};

TEST_F(IcpTest, MeasuresInEitherOrderOfTheIds) {
  expect_truth(registration_->match(7, 3));
  expect_truth(registration_->match(3, 7));
}

TEST_F(IcpTest, SearchesWhereAPoorGuessSaysAndRefinesAGoodOne) {
  expect_truth(registration_->match_proposed(
      {.earlier = 7, .later = 3, .expected = expected(Pose2(1.3, -0.2, 0.1), 0.5, 0.1)}));
  expect_truth(registration_->match_proposed(
      {.earlier = 7,
       .later = 3,
       .expected = expected(truth_ * Pose2(0.1, 0.1, 0.05), 0.05, 0.02)}));
  expect_truth(registration_->match_proposed(
      {.earlier = 3, .later = 7, .expected = expected(truth_.inverse(), 1e6, 1e6)}));
}

TEST_F(IcpTest, WithoutAnExpectedPoseTheWindowIsAroundIdentity) {
  expect_truth(registration_->match_proposed({.earlier = 7, .later = 3, .expected = {}}));
  const auto narrow = registry_.make<Registration>("icp:range_x=0.1,range_y=0.1,angle=0.05");
  narrow->begin({});
  query<ScanRegistration>(*narrow)->take(7, room_.scan(first_));
  query<ScanRegistration>(*narrow)->take(3, room_.scan(first_ * Pose2(1.5, 1.0, 0.3)));
  EXPECT_THAT(narrow->match(7, 3), IsEmpty());
}

TEST_F(IcpTest, APoseWithoutAScanDoesNotMatch) {
  EXPECT_THAT(registration_->match(7, 99), IsEmpty());
  EXPECT_THAT(registration_->match(7, 7), IsEmpty());
  registration_->pose_ended(3, true);
  EXPECT_THAT(registration_->match(7, 3), SizeIs(1));
  registration_->pose_ended(3, false);
  EXPECT_THAT(registration_->match(7, 3), IsEmpty());
}

TEST_F(IcpTest, AnExpectedPoseInSpaceIsRefused) {
  try {
    registration_->match_proposed(
        {.earlier = 7, .later = 3, .expected = {std::vector<double>(7), std::vector<double>(36)}});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("planar poses"));
  }
}

TEST_F(IcpTest, KeepsItsScansThroughBegin) {
  registration_->begin({});
  expect_truth(registration_->match(7, 3));
}

}  // namespace
}  // namespace cairn
