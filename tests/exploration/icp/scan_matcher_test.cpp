// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "generated_floors.hpp"
#include "scan_matcher.hpp"

namespace cairn {
namespace {

using icp::ScanMatch;
using icp::ScanMatcher;
using icp::SearchWindow;
using icp::Verdict;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
const SearchWindow kWindow{};

ScanMatch search(const LaserScan& earlier, const LaserScan& later, const Pose2& guess = {},
                 const SearchWindow& window = kWindow) {
  const ScanMatcher matcher;
  return matcher.search(matcher.prepare(earlier), matcher.prepare(later), guess, window);
}

ScanMatch refine(const LaserScan& earlier, const LaserScan& later, const Pose2& guess) {
  const ScanMatcher matcher;
  return matcher.refine(matcher.prepare(earlier), matcher.prepare(later), guess);
}

/// Within 5 mm and 0.1°.
void expect_near(const Pose2& found, const Pose2& truth) {
  const Eigen::Vector3d error = found.local(truth);
  EXPECT_LT(error.head<2>().norm(), 0.005) << found << " instead of " << truth;
  EXPECT_LT(std::abs(error[2]), 0.0018) << found << " instead of " << truth;
}

/// Of the direction with the angle [m].
double deviation(const ScanMatch& match, double angle) {
  const Eigen::Vector3d d(std::cos(angle), std::sin(angle), 0.0);
  return std::sqrt(d.dot(match.covariance * d));
}

TEST(ScanMatcher, AnExactMotionIsRecoveredFromAPoorGuess) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2);
  for (const Pose2& truth : {Pose2(0.6, 0.3, 0.3), Pose2(-0.5, 0.8, -0.25), Pose2(0.9, -0.7, 0.1),
                             Pose2(0.0, 0.0, 0.35)}) {
    const LaserScan earlier = room.scan(first), later = room.scan(first * truth);
    const ScanMatch match = search(earlier, later);
    EXPECT_EQ(match.verdict, Verdict::accepted);
    EXPECT_EQ(match.unobserved, 0);
    expect_near(match.pose, truth);
  }
}

TEST(ScanMatcher, AnExactMotionIsRecoveredFromAGoodGuessWithoutASearch) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(2.0, 2.0, -0.4), truth(0.5, -0.2, 0.2);
  const ScanMatch match =
      refine(room.scan(first), room.scan(first * truth), truth * Pose2(0.15, -0.1, 0.08));
  EXPECT_EQ(match.verdict, Verdict::accepted);
  expect_near(match.pose, truth);
}

TEST(ScanMatcher, IdenticalScansAreAtOnePlace) {
  const LaserScan scan = test::furnished_room().scan(Pose2(1.5, 1.8, 0.2));
  const ScanMatch match = search(scan, scan, Pose2(0.4, -0.3, 0.1));
  EXPECT_EQ(match.verdict, Verdict::accepted);
  EXPECT_TRUE(match.pose.equals(Pose2(), 1e-3)) << match.pose;
  EXPECT_TRUE(refine(scan, scan, Pose2()).pose.equals(Pose2(), 1e-6));
}

TEST(ScanMatcher, TheInverseOrderGivesTheInversePose) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2), truth(0.6, 0.3, 0.3);
  const LaserScan earlier = test::with_noise(room.scan(first), 0.02, 1);
  const LaserScan later = test::with_noise(room.scan(first * truth), 0.02, 2);
  const ScanMatch there = search(earlier, later), back = search(later, earlier);
  ASSERT_TRUE(there.accepted());
  ASSERT_TRUE(back.accepted());
  EXPECT_TRUE(back.pose.equals(there.pose.inverse(), 1e-3));
  const Eigen::Matrix3d Ad = there.pose.adjoint();
  const Eigen::Matrix3d inverse = Ad * there.covariance * Ad.transpose();
  EXPECT_LT((back.covariance - inverse).norm(), 0.05 * inverse.norm());
}

TEST(ScanMatcher, TheCovarianceIsThatOfTheErrors) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2), truth(0.4, 0.2, 0.2);
  double nees = 0.0;
  constexpr int kPairs = 200;
  for (unsigned k = 0; k < kPairs; ++k) {
    const ScanMatch match = search(test::with_noise(room.scan(first), 0.02, 2 * k + 1),
                                   test::with_noise(room.scan(first * truth), 0.02, 2 * k + 2));
    ASSERT_TRUE(match.accepted());
    const Eigen::Vector3d error = match.pose.local(truth);
    nees += error.dot(match.covariance.inverse() * error) / kPairs;
  }
  EXPECT_GT(nees, 1.5);
  EXPECT_LT(nees, 4.5);
}

TEST(ScanMatcher, AlongACorridorTheCovarianceIsLarge) {
  const test::Walls corridor = test::corridor();
  int accepted = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const double heading = 0.2 * seed;
    const Pose2 first(0, 0.1, heading), truth(0.5, 0.1, 0.1);
    const double sigma = 0.002 * seed;
    const LaserScan earlier = test::with_noise(corridor.scan(first), sigma, seed);
    const LaserScan later = test::with_noise(corridor.scan(first * truth), sigma, seed + 100);
    const ScanMatch found = search(earlier, later, truth * Pose2(0.4, 0.4, 0.2));
    if (!found.accepted()) continue;
    ++accepted;
    EXPECT_GE(found.unobserved, 1) << "seed " << seed;
    // ξ is in the frame of the later scan.
    const double along = -(first * truth).theta();
    EXPECT_GT(deviation(found, along), 0.9) << "seed " << seed;
    EXPECT_LT(deviation(found, along), 2.0) << "seed " << seed;
    EXPECT_LT(deviation(found, along + std::numbers::pi / 2), 0.1) << "seed " << seed;
    const Eigen::Vector3d error = found.pose.local(truth);
    EXPECT_LT(error.dot(found.covariance.inverse() * error), 20.0) << "seed " << seed;
  }
  EXPECT_GE(accepted, 20);
}

TEST(ScanMatcher, ACorridorWithoutNoiseIsAcceptedAcross) {
  const test::Walls corridor = test::corridor();
  const Pose2 truth(0.3, 0.2, 0.1);
  const ScanMatch found = search(corridor.scan(Pose2()), corridor.scan(truth));
  EXPECT_EQ(found.verdict, Verdict::accepted);
  EXPECT_EQ(found.unobserved, 1);
  EXPECT_NEAR(found.pose.theta(), truth.theta(), 0.002);
  EXPECT_NEAR(found.pose.y(), truth.y(), 0.01);
}

TEST(ScanMatcher, ScansOfDifferentRoomsAreRejected) {
  test::Walls other;
  other.polygon({{0, 0}, {3, 0}, {3, 1}, {4.5, 2}, {3, 5}, {0.5, 4.5}, {1, 2.5}});
  const ScanMatch match =
      search(test::furnished_room().scan(Pose2(1.5, 1.8, 0.2)), other.scan(Pose2(2.0, 2.2, 1.0)));
  EXPECT_FALSE(match.accepted()) << match.pose;
}

TEST(ScanMatcher, RepeatedFeaturesAreAmbiguous) {
  // Pilasters every 0.6 m on both walls of a corridor.
  std::vector<Eigen::Vector2d> corners;
  for (double x = -30.0; x < 29.9; x += 0.6)
    for (const auto& [dx, y] : {std::pair{0.0, -1.0}, {0.3, -1.0}, {0.3, -0.8}, {0.6, -0.8}})
      corners.emplace_back(x + dx, y);
  for (double x = 30.0; x > -29.9; x -= 0.6)
    for (const auto& [dx, y] : {std::pair{0.0, 1.0}, {-0.3, 1.0}, {-0.3, 0.8}, {-0.6, 0.8}})
      corners.emplace_back(x + dx, y);
  test::Walls walls;
  walls.polygon(corners);
  const ScanMatch match = search(walls.scan(Pose2(0.1, 0, 0)), walls.scan(Pose2(0.4, 0.1, 0.05)));
  EXPECT_EQ(match.verdict, Verdict::ambiguous);
}

TEST(ScanMatcher, BeamsThatMeasuredNothingAreLeftOut) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2), truth(0.6, 0.3, 0.3);
  LaserScan earlier = room.scan(first), later = room.scan(first * truth);
  for (std::size_t k = 0; k < earlier.ranges.size(); k += 9) earlier.ranges[k] = kNaN;
  for (std::size_t k = 4; k < later.ranges.size(); k += 9) later.ranges[k] = 0.0F;
  for (std::size_t k = 2; k < later.ranges.size(); k += 30) later.ranges[k] = -1.0F;
  later.ranges[77] = std::numeric_limits<float>::infinity();
  const ScanMatch match = search(earlier, later);
  EXPECT_EQ(match.verdict, Verdict::accepted);
  expect_near(match.pose, truth);
}

TEST(ScanMatcher, ScansWithHardlyAnythingInThemAreRejected) {
  const LaserScan room = test::furnished_room().scan(Pose2(1.5, 1.8, 0.2));
  const LaserScan none{};
  LaserScan blind = room, one{0.0, 0.0, 8.0, {2.0F}}, few = room;
  blind.ranges.assign(blind.ranges.size(), kNaN);
  few.ranges.assign(few.ranges.size(), 8.0F);
  few.ranges[90] = 2.0F;
  for (const LaserScan& empty : {none, blind, one, few}) {
    for (const auto& [a, b] : {std::pair{empty, room}, {room, empty}, {empty, empty}}) {
      EXPECT_FALSE(search(a, b).accepted());
      EXPECT_FALSE(refine(a, b, Pose2()).accepted());
    }
  }
}

TEST(ScanMatcher, ScansThatMakeNoSenseAreRejected) {
  const LaserScan room = test::furnished_room().scan(Pose2(1.5, 1.8, 0.2));
  LaserScan nowhere = room, one_beam = room, endless = room, backwards = room, fan = room;
  nowhere.first_angle = std::numeric_limits<double>::quiet_NaN();
  one_beam.angle_step = 0.0;
  one_beam.ranges.assign(181, 2.0F);
  endless.max_range = std::numeric_limits<double>::infinity();
  endless.ranges.assign(181, 1e30F);
  backwards.max_range = -1.0;
  fan.angle_step = 1e-300;
  for (const LaserScan& scan : {nowhere, one_beam, endless, backwards, fan}) {
    for (const auto& [a, b] : {std::pair{scan, room}, {room, scan}, {scan, scan}}) {
      EXPECT_FALSE(search(a, b).accepted());
      EXPECT_FALSE(refine(a, b, Pose2(0.1, 0.0, 0.0)).accepted());
    }
  }
}

TEST(ScanMatcher, AGuessFarFromEverythingOrNoNumberIsRejected) {
  const LaserScan room = test::furnished_room().scan(Pose2(1.5, 1.8, 0.2));
  for (const double x : {30.0, 1e12, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_FALSE(search(room, room, Pose2(x, 0.0, 0.0)).accepted());
    EXPECT_FALSE(refine(room, room, Pose2(x, 0.0, 0.0)).accepted());
  }
}

TEST(ScanMatcher, AWindowWithoutExtentIsTheGuess) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2), truth(0.1, 0.05, 0.02);
  const ScanMatch match =
      search(room.scan(first), room.scan(first * truth), Pose2(), {.x = 0, .y = 0, .angle = 0});
  EXPECT_EQ(match.verdict, Verdict::accepted);
  expect_near(match.pose, truth);
}

TEST(ScanMatcher, AFullCircleOfBeamsThatRunClockwiseMatches) {
  const test::Walls room = test::furnished_room();
  const LidarModel lidar{.aperture = 2.0 * std::numbers::pi, .beams = 360};
  const Pose2 first(1.5, 1.8, 0.2), truth(0.6, 0.3, 0.3);
  const auto reversed = [](LaserScan scan) {
    scan.first_angle = scan.angle(scan.ranges.size() - 1);
    scan.angle_step = -scan.angle_step;
    std::ranges::reverse(scan.ranges);
    return scan;
  };
  const ScanMatch match =
      search(reversed(room.scan(first, lidar)), room.scan(first * truth, lidar));
  EXPECT_EQ(match.verdict, Verdict::accepted);
  expect_near(match.pose, truth);
}

TEST(ScanMatcher, TheSameComesOutAgain) {
  const test::Walls room = test::furnished_room();
  const LaserScan earlier = test::with_noise(room.scan(Pose2(1.5, 1.8, 0.2)), 0.03, 1);
  const LaserScan later = test::with_noise(room.scan(Pose2(1.9, 2.1, 0.4)), 0.03, 2);
  const ScanMatch a = search(earlier, later), b = search(earlier, later);
  EXPECT_EQ(a.pose.state(), b.pose.state());
  EXPECT_EQ(a.covariance, b.covariance);
}

}  // namespace
}  // namespace cairn
