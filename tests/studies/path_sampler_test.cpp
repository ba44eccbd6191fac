// SPDX-License-Identifier: BSD-3-Clause
#include "path_sampler.hpp"

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/grid/ray_caster.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/build.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

/// With these a cell is known for good once it is seen.
constexpr const char* kAtOnce = "log_odds:hit=4.2,miss=4.2,limit=4.2,smooth=false,tolerance=0";
/// What that changes in its entropy: ln 2 − H(p) at log odds of ±4.2 [nats].
const double kWorth = [] {
  const double odds = std::exp(-4.2);
  return std::numbers::ln2 - std::log1p(odds) - 4.2 * odds / (1.0 + odds);
}();

/// A robot that has driven two steps along a corridor, with the odometry it has.
struct Corridor {
  Corridor(const OdometryModel& odometry, const char* mapper_name) : name(mapper_name) {
    robot.lidar = {.aperture = std::numbers::pi, .beams = 181, .range = 3.0, .sigma = 0.0};
    robot.odometry = odometry;
    estimator = registry.make<Estimator>(parse_component("incremental_cholesky"));
    mapper = registry.make<Mapper>(parse_component(name));
    GraphUpdate update;
    for (Id id = 0; id < 3; ++id) {
      poses.emplace_back(1.05 + 0.4 * static_cast<double>(id), 1.55, 0.0);
      ids.push_back(id);
      Variable pose = make_variable(id, poses.back(), registry);
      pose.fixed = id == 0;
      update.variables.push_back(pose);
      scans.push_back(scan(poses.back()));
      mapper->add(poses.back(), scans.back());
      if (id == 0) continue;
      const Pose2 motion(0.4, 0.0, 0.0);
      update.factors.push_back(make_factor(Between(id - 1, id, motion),
                                           Information::covariance(odometry.covariance(motion)),
                                           nullptr, registry));
    }
    estimator->update(update);
  }

  LaserScan scan(const Pose2& at) const {
    LaserScan result{.first_angle = robot.lidar.first_angle(),
                     .angle_step = robot.lidar.step(),
                     .max_range = robot.lidar.range,
                     .ranges = {}};
    for (std::size_t beam = 0; beam < 181; ++beam) {
      const double angle = at.theta() + result.angle(beam);
      const RayHit hit = walls.cast(at.translation(), angle, result.max_range);
      result.ranges.push_back(static_cast<float>(hit.hit ? hit.range : result.max_range));
    }
    return result;
  }

  SampledPath sampled(const PlannedPath& path, int samples) {
    const Situation situation{.estimator = *estimator,
                              .poses = ids,
                              .pose = poses.back(),
                              .map = mapper->map(),
                              .robot = robot};
    const auto drawing = registry.make<Mapper>(parse_component(name));
    PathSampler sampler(situation, scans, poses, *drawing, registry,
                        {.samples = samples, .range = 3.0}, 1);
    return sampler.sample(path);
  }

  /// Straight on; back, if the length is below zero.
  PlannedPath ahead(double length) const {
    return {.points = {poses.back().translation(),
                       poses.back().translation() + Eigen::Vector2d(length, 0.0)},
            .length = std::abs(length)};
  }

  static OccupancyGrid corridor() {
    const std::string wall(100, '#'), floor(100, '.');
    std::vector<std::string> rows(33, floor);
    rows.front() = rows.back() = wall;
    return test::drawn_floor(rows, 0.1);
  }

  const char* name;
  Registry registry;
  RobotModel robot;
  RayCaster walls{corridor()};
  std::unique_ptr<Estimator> estimator;
  std::unique_ptr<Mapper> mapper;
  std::vector<Id> ids;
  std::vector<Pose2> poses;
  std::vector<LaserScan> scans;
};

const OdometryModel kSure{.absolute = Eigen::Vector3d::Constant(1e-7), .relative = 0.0};

TEST(PathSampler, WithoutErrorsItIsWhatTheCellsAreWorth) {
  Corridor corridor(kSure, kAtOnce);
  const SampledPath path = corridor.sampled(corridor.ahead(2.0), 3);
  EXPECT_NEAR(path.length, 2.0, 1e-9);
  ASSERT_LT(path.map, -1.0);
  EXPECT_NEAR(path.sampled_map / path.map, kWorth / std::numbers::ln2, 0.03);
  EXPECT_LT(path.standard_error, 0.01 * std::abs(path.sampled_map));
}

TEST(PathSampler, WhatIsDiscoveredErrsAsThePathDoes) {
  // In a corridor only errors along it matter, and move the border of what is known.
  constexpr double kSigma = 0.05;
  constexpr int kSamples = 200;
  Corridor corridor({.absolute = Eigen::Vector3d(kSigma, 1e-7, 1e-7), .relative = 0.0}, kAtOnce);
  const SampledPath path = corridor.sampled(corridor.ahead(2.0), kSamples);
  const double deviation = path.standard_error * std::sqrt(kSamples);
  const double steps = 4.0, width = 3.1;
  EXPECT_NEAR(deviation, kSigma * std::sqrt(steps) * width * kWorth, 0.2 * deviation);
  const SampledPath sure = Corridor(kSure, kAtOnce).sampled(corridor.ahead(2.0), 2);
  EXPECT_NEAR(path.sampled_map, sure.sampled_map, 4.0 * path.standard_error);
  EXPECT_NEAR(path.end(0, 0) - path.now(0, 0), steps * kSigma * kSigma, 1e-6);
}

TEST(PathSampler, RefusesScansWithoutPoses) {
  Corridor corridor(kSure, kAtOnce);
  corridor.scans.pop_back();
  EXPECT_THROW(corridor.sampled(corridor.ahead(1.0), 2), Error);
}

}  // namespace
}  // namespace cairn
