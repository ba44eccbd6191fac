// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/map_log.hpp"
#include "cairn/exploration/map_truth.hpp"
#include "cairn/exploration/scan_log.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

ScanLog read(const std::string& text, const std::string& options = "range=20") {
  return Registry().make<ScanLogFormat>(parse_component("carmen:" + options))->read(text, "a.clf");
}

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    return error.what();
  }
  return "taken";
}

TEST(Carmen, ScansAreReadWithTheLasersPose) {
  const ScanLog log = read(
      "# a comment\nPARAM robot_length 0.47 1.0 host 1.0\nODOM 1 2 0.5 0 0 0 9.5 host 0.1\n"
      "FLASER 4 1.5 25.25 81.91 3 1 2 0.5 1.1 2.1 0.6 10.25 host 0.2\r\n\n"
      "FLASER 3 1 2 3 -1 -2 -0.5 0 0 0 11 host 0.3");
  ASSERT_EQ(log.scans.size(), 2U);
  const LoggedScan& first = log.scans.front();
  EXPECT_EQ(first.stamp, 10.25);
  EXPECT_EQ(first.odometry.x(), 1.0);
  EXPECT_EQ(first.odometry.theta(), 0.5);
  ASSERT_EQ(first.scan.ranges.size(), 4U);
  EXPECT_EQ(first.scan.ranges[0], 1.5F);
  EXPECT_EQ(first.scan.ranges[1], 20.0F);  // free as far as it is trusted
  EXPECT_TRUE(std::isnan(first.scan.ranges[2]));
  // An even number of beams ends a step before the left, an odd one there.
  EXPECT_DOUBLE_EQ(first.scan.angle(0), -0.5 * pi);
  EXPECT_DOUBLE_EQ(first.scan.angle(3), 0.25 * pi);
  EXPECT_DOUBLE_EQ(log.scans[1].scan.angle(2), 0.5 * pi);
}

TEST(Carmen, WhatCannotBeReadIsNamedWithItsLine) {
  EXPECT_THAT(refusal("ODOM 1 2 3\n"), HasSubstr("no line begins with FLASER"));
  EXPECT_THAT(refusal("\nFLASER 3 1 2 3 0 0\n"), HasSubstr("a.clf:2: theta is missing"));
  EXPECT_THAT(refusal("FLASER 2 1 x 0 0 0 0 0 0 1 h 1"), HasSubstr("'x' is no finite number"));
  EXPECT_THAT(refusal("FLASER 2 1 nan 0 0 0 0 0 0 1 h 1"), HasSubstr("no finite number"));
  EXPECT_THAT(refusal("FLASER 1e9 1 2 0 0 0 0 0 0 1 h 1"), HasSubstr("no number of readings"));
  EXPECT_THAT(refusal("FLASER 2.5 1 2 0 0 0 0 0 0 1 h 1"), HasSubstr("no number of readings"));
  EXPECT_THAT(refusal("FLASER -1"), HasSubstr("no number of readings"));
  EXPECT_THAT(refusal("FLASER"), HasSubstr("no line begins"));
  EXPECT_THAT(refusal("ROBOTLASER1 0 -1.57 3.14"), HasSubstr("ROBOTLASER1 lines are not"));
  EXPECT_THAT(refusal("\nFLASER 1 2 1e300 0 0 0 0 0 1 h 1"), HasSubstr("a.clf:2: x is 1e+300"));
  EXPECT_THAT(refusal("FLASER 1 2 0 0 -1e300 0 0 0 1 h 1"), HasSubstr("theta is -1e+300"));
}

TEST(Carmen, WhatIsWrittenIsReadAgain) {
  ScanLog log;
  RandomNumbers random(3);
  for (int k = 0; k < 5; ++k) {
    LoggedScan logged{.stamp = 1.5 * k,
                      .odometry = {random.gaussian(), random.gaussian(), random.gaussian()},
                      .scan = {.first_angle = -0.5 * pi,
                               .angle_step = pi / 180.0,
                               .max_range = k < 3 ? 8.0 : 12.5,
                               .ranges = {}}};
    for (int beam = 0; beam <= 180; ++beam)
      logged.scan.ranges.push_back(static_cast<float>(8.0 * random.uniform()));
    logged.scan.ranges[3] = 8.0F;
    logged.scan.ranges[7] = std::numeric_limits<float>::quiet_NaN();
    if (k != 2) logged.truth = Pose2(random.gaussian(), random.gaussian(), 0.1 * k);
    log.scans.push_back(logged);
  }
  const auto format = Registry().make<ScanLogFormat>(parse_component("carmen"));
  const ScanLog again = format->read(format->write(log), "again");
  ASSERT_EQ(again.scans.size(), log.scans.size());
  for (std::size_t k = 0; k < log.scans.size(); ++k) {
    const LoggedScan &a = log.scans[k], &b = again.scans[k];
    EXPECT_EQ(a.stamp, b.stamp);
    EXPECT_EQ(a.odometry.state(), b.odometry.state());
    EXPECT_EQ(a.scan.max_range, b.scan.max_range);
    EXPECT_NEAR(a.scan.angle(180), b.scan.angle(180), 1e-12);
    ASSERT_EQ(a.truth.has_value(), b.truth.has_value()) << k;
    if (a.truth) {
      EXPECT_EQ(a.truth->state(), b.truth->state());
    }
    for (std::size_t beam = 0; beam < a.scan.ranges.size(); ++beam) {
      const float x = a.scan.ranges[beam], y = b.scan.ranges[beam];
      EXPECT_TRUE(x == y || (std::isnan(x) && std::isnan(y))) << x << " " << y;
    }
  }
}

TEST(Carmen, AScanOfALongRangeWithInfiniteReadingsIsReadAgain) {
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  ScanLog log;
  log.scans.push_back({.odometry = {},
                       .scan = {.first_angle = -0.5 * pi,
                                .angle_step = 0.5 * pi,
                                .max_range = 30.0,
                                .ranges = {25.0F, kInfinite, -kInfinite}}});
  const std::string text = Registry().make<ScanLogFormat>(parse_component("carmen"))->write(log);
  const LaserScan trusted = read(text, "range=30").scans.front().scan;
  EXPECT_EQ(trusted.max_range, 30.0);
  EXPECT_EQ(trusted.ranges, (std::vector<float>{25.0F, 30.0F, 0.0F}));
  EXPECT_EQ(measured_beams(trusted), measured_beams(log.scans.front().scan));
  EXPECT_EQ(read(text, "none=80").scans.front().scan.max_range, 20.0);  // unless it is asked for
}

TEST(Carmen, ScansThatItCannotHoldAreRefused) {
  const auto refusal = [](const LidarModel& lidar) -> std::string {
    ScanLog log;
    log.scans.push_back(
        {.odometry = {},
         .scan = {.first_angle = lidar.first_angle(),
                  .angle_step = lidar.step(),
                  .max_range = lidar.range,
                  .ranges = std::vector<float>(static_cast<std::size_t>(lidar.beams), 1.0F)}});
    try {
      Registry().make<ScanLogFormat>(parse_component("carmen"))->write(log);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      return error.what();
    }
    return "written";
  };
  EXPECT_EQ(refusal({}), "written");
  EXPECT_THAT(refusal({.aperture = 1.5 * pi}), HasSubstr("181 beams over 270°"));
  EXPECT_THAT(refusal({.beams = 180}), HasSubstr("an odd number of beams over 180°"));
  EXPECT_THAT(refusal({.beams = 1}), HasSubstr("1 beams"));
  EXPECT_THAT(refusal({.range = 100.0}), HasSubstr("less than 80 m"));
}

TEST(Carmen, TruthAndRangeAreThoseOfTheScansBehind) {
  const std::string scan = "FLASER 3 1 9 30 1 2 0.5 0 0 0 1 h 1\n";
  const ScanLog log =
      read(scan + "PARAM robot_front_laser_max 8 1 h 1\nTRUEPOS 4 5 0.25 0 0 0 1 h 1\n" + scan +
           scan + "PARAM robot_front_laser_max 50 1 h 1\n" + scan);
  ASSERT_EQ(log.scans.size(), 4U);
  EXPECT_EQ(log.scans[0].scan.max_range, 20.0);
  EXPECT_EQ(log.scans[1].scan.max_range, 8.0);
  EXPECT_EQ(log.scans[1].scan.ranges[1], 8.0F);
  EXPECT_EQ(log.scans[3].scan.max_range, 20.0);  // no farther than it is trusted
  EXPECT_FALSE(log.scans[0].truth);
  ASSERT_TRUE(log.scans[1].truth);
  EXPECT_EQ(log.scans[1].truth->y(), 5.0);
  EXPECT_FALSE(log.scans[2].truth);
  EXPECT_THAT(refusal(scan + "TRUEPOS 1 x 2\n"), HasSubstr("a.clf:2: 'x' is no finite number"));
  EXPECT_THAT(refusal("PARAM robot_front_laser_max 0 1 h 1\n" + scan),
              HasSubstr("a.clf:1: 0 is no range of a laser"));
}

ScanSlam slam_of(Registry& registry, PosePolicy& policy, Registration& matcher, Mapper& mapper) {
  return ScanSlam({policy, matcher, mapper, registry});
}

TEST(MapLog, ALogWithoutAMeasurementIsRefusedAndTimesMayRunBackwards) {
  Registry registry;
  const auto policy = registry.make<PosePolicy>("compact_pose");
  const auto matcher = registry.make<Registration>("icp");
  const auto mapper = registry.make<Mapper>("log_odds");
  const auto refusal = [&](const std::string& text) -> std::string {
    ScanSlam slam = slam_of(registry, *policy, *matcher, *mapper);
    try {
      map_log(read(text), slam, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    return "mapped";
  };
  EXPECT_THAT(refusal("FLASER 3 81.9 0 -1 0 0 0 0 0 0 1 h 1\nFLASER 1 90 1 0 0 0 0 0 2 h 2\n"),
              HasSubstr("no range of the 2 scans"));
  ScanSlam slam = slam_of(registry, *policy, *matcher, *mapper);
  const MappedLog mapped =
      map_log(read("FLASER 1 5 0 0 0 0 0 0 9 h 9\nFLASER 1 5 0 0 0 0 0 0 2 h 2\n"), slam, {});
  EXPECT_EQ(mapped.duration, 7.0);
}

/// A drive along a hall, a turn on the spot and back, with exact scans and odometry that is wrong
/// by a constant turn.
struct HallDrive {
  ScanLog log;
  Pose2 truth, odometry;  ///< at the end
};

HallDrive drive_along(const OccupancyGrid& floor, const Pose2& start, int scans) {
  const RayCaster rays(floor);
  HallDrive drive{.log = {}, .truth = start, .odometry = start};
  for (int k = 0; k < scans; ++k) {
    LoggedScan logged{
        .stamp = 0.1 * k,
        .odometry = drive.odometry,
        .scan = {.first_angle = -0.5 * pi, .angle_step = pi / 180, .max_range = 8.0, .ranges = {}}};
    for (int beam = 0; beam <= 180; ++beam) {
      const double angle = drive.truth.theta() + logged.scan.angle(static_cast<std::size_t>(beam));
      const RayHit hit = rays.cast(drive.truth.translation(), angle, 8.0);
      logged.scan.ranges.push_back(static_cast<float>(hit.range));
    }
    drive.log.scans.push_back(std::move(logged));
    const bool turns = k >= 40 && k < 50;
    const Pose2 motion = turns ? Pose2(0.0, 0.0, 0.1 * pi) : Pose2(0.22, 0.0, 0.0);
    if (k + 1 == scans) break;
    drive.truth = drive.truth * motion;
    drive.odometry = drive.odometry * Pose2(motion.x(), 0.0, motion.theta() + 0.01);
  }
  return drive;
}

/// From 25 starts: where a single drive ends depends on which matches it happens to make.
TEST(MapLog, AMapIsBuiltAndOdometryCorrected) {
  Registry registry;
  if (!registry.has("registration", "icp")) GTEST_SKIP() << "without icp";
  const OccupancyGrid floor = test::drawn_floor(
      {"##############", "#............#", "#..##........#", "#..##....##..#", "#........##..#",
       "#............#", "#...##.......#", "#............#", "##############"});
  constexpr int kScans = 90;
  RandomNumbers random(1);
  std::vector<double> errors;  // as parts of odometry's
  for (int drive = 0; drive < 25; ++drive) {
    Pose2 start(2.0, 3.5, 0.0);
    if (drive > 0) {
      start = {random.uniform(1.6, 2.4), random.uniform(3.2, 3.8), random.uniform(-0.05, 0.05)};
    }
    const HallDrive driven = drive_along(floor, start, kScans);
    const auto policy =
        registry.make<PosePolicy>(parse_component("compact_pose:range=2,angle=3.14,reuse=false"));
    const auto icp = registry.make<Registration>("icp");
    const auto mapper = registry.make<Mapper>("log_odds");
    ScanSlam slam({*policy, *icp, *mapper, registry});
    const MappedLog result = map_log(driven.log, slam, {.step = 0.2, .turn = 0.2});
    EXPECT_TRUE(result.converged);
    EXPECT_EQ(result.scans, static_cast<std::size_t>(kScans));  // each is a step further
    EXPECT_GT(slam.counts().loops, 30);
    const auto error = [&](const Pose2& pose) {
      return (pose.translation() - driven.truth.translation()).norm();
    };
    EXPECT_GT(error(driven.odometry), 1.0);
    errors.push_back(error(slam.poses().back()) / error(driven.odometry));
    EXPECT_LT(errors.back(), 0.5) << "drive " << drive;
    if (drive > 0) continue;
    // Free floor is free.
    const MapTruth against = compare_with_floor(slam.map(), floor, {}, {2.0, 3.5});
    EXPECT_GT(against.seen, 0.9 * against.floor);
    EXPECT_LT(against.occupied_wrong, 0.02 * against.floor);
  }
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], 0.1);
}

}  // namespace
}  // namespace cairn
