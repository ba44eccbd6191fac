// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/world.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

/// 8 m × 6 m inside, a pillar of 1 m in it.
OccupancyGrid hall() {
  return test::drawn_floor({"##########", "#........#", "#........#", "#....#...#", "#........#",
                            "#........#", "#........#", "##########"});
}

std::unique_ptr<World> robot(const std::string& options) {
  return Registry().make<World>(parse_component("lidar_building:" + options));
}

constexpr const char* kExact = "relative=0,sigma_xy=1e-6,sigma_theta=1e-6,range_sigma=0,beams=37";

TEST(LidarBuilding, ScansAreTheRaysOfTheFloor) {
  const OccupancyGrid floor = hall();
  const RayCaster rays(floor);
  const auto world = robot(std::string(kExact) + ",range=5,fov=360");
  const LaserScan scan = world->begin({.floor = &floor, .pose = Pose2(2.3, 4.1, 0.7)});
  ASSERT_EQ(scan.ranges.size(), 37U);
  EXPECT_NEAR(scan.angle_step, 2.0 * pi / 37, 1e-12);
  EXPECT_NEAR(scan.angle(18), 0.0, 1e-12);  // the one in the middle looks ahead
  int far = 0;
  for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
    const RayHit hit = rays.cast({2.3, 4.1}, 0.7 + scan.angle(beam), 5.0);
    EXPECT_FLOAT_EQ(scan.ranges[beam], static_cast<float>(hit.hit ? hit.range : 5.0));
    far += !hit.hit;
  }
  EXPECT_GT(far, 0);
}

TEST(LidarBuilding, MovesExactlyAndMeasuresWithTheNoiseItStates) {
  const OccupancyGrid floor = hall();
  const auto world = robot("relative=0.1,sigma_xy=0.02,sigma_theta=0.01,beams=1");
  Eigen::Vector3d squares = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero();
  constexpr int kSteps = 4000;
  world->begin({.floor = &floor, .pose = Pose2(2.0, 2.0, 0.0), .seed = 5});
  for (int k = 0; k < kSteps; ++k) {
    // There and back.
    const Pose2 there(0.5, 0.0, 0.2), motion = k % 2 == 0 ? there : there.inverse();
    const Pose2 before = *world->truth();
    const WorldStep step = world->move(motion);
    const Pose2 moved = before.between(*world->truth());
    ASSERT_FALSE(step.collided);
    ASSERT_LT(moved.local(motion).norm(), 1e-12);
    const Eigen::Vector3d error = moved.local(step.odometry);
    const Eigen::Vector3d scaled = error.cwiseQuotient(step.covariance.diagonal().cwiseSqrt());
    mean += scaled;
    squares += scaled.cwiseAbs2();
    if (k % 2 != 0) continue;
    EXPECT_NEAR(step.covariance(0, 0), 0.02 * 0.02 + 0.05 * 0.05, 1e-12);
    EXPECT_NEAR(step.covariance(2, 2), 0.01 * 0.01 + 0.02 * 0.02, 1e-12);
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(mean[k] / kSteps, 0.0, 0.07);
    EXPECT_NEAR(squares[k] / kSteps, 1.0, 0.1);
  }
}

TEST(LidarBuilding, StopsAtWalls) {
  const OccupancyGrid floor = hall();
  const auto world = robot(std::string(kExact) + ",radius=0.3,step=20");
  world->begin({.floor = &floor, .pose = Pose2(2.5, 2.5, 0.0)});
  const WorldStep step = world->move(Pose2(20.0, 0.0, 0.0));
  EXPECT_TRUE(step.collided);
  // The wall is at x = 9; strides are a quarter of a cell.
  EXPECT_LE(world->truth()->x(), 9.0 - 0.3 + 1e-9);
  EXPECT_GT(world->truth()->x(), 9.0 - 0.3 - 0.26);
  EXPECT_NEAR(step.odometry.x(), world->truth()->x() - 2.5, 1e-4);
  EXPECT_FALSE(world->move(Pose2(-3.0, 0.0, 0.0)).collided);  // away from it
}

TEST(LidarBuilding, PassesAPillarOnlyWhereItsBodyDoes) {
  const OccupancyGrid floor = hall();
  const auto world = robot(std::string(kExact) + ",radius=0.4,step=20");
  // The pillar covers x 5 to 6, y 4 to 5.
  world->begin({.floor = &floor, .pose = Pose2(2.0, 3.55, 0.0)});
  EXPECT_FALSE(world->move(Pose2(6.0, 0.0, 0.0)).collided);
  world->begin({.floor = &floor, .pose = Pose2(2.0, 3.65, 0.0)});
  EXPECT_TRUE(world->move(Pose2(6.0, 0.0, 0.0)).collided);
}

TEST(LidarBuilding, TheSameSeedGivesTheSameNoiseWhateverWasDriven) {
  const OccupancyGrid floor = hall();
  const auto first = robot("beams=5"), second = robot("beams=5");
  const WorldStart start{.floor = &floor, .pose = Pose2(2.5, 2.5, 0.0), .seed = 9};
  const LaserScan a = first->begin(start), b = second->begin(start);
  EXPECT_EQ(a.ranges, b.ranges);
  const Pose2 motion(0.3, 0.0, 0.1);
  EXPECT_EQ(first->move(motion).odometry.x(), second->move(motion).odometry.x());
  WorldStart other = start;
  other.seed = 10;
  EXPECT_NE(first->begin(other).ranges, a.ranges);
  EXPECT_EQ(first->begin(start).ranges, a.ranges);  // from the beginning again
}

TEST(LidarBuilding, DropoutsAreNoMeasurements) {
  const OccupancyGrid floor = hall();
  const auto world = robot("dropouts=0.25,beams=2000");
  const LaserScan scan = world->begin({.floor = &floor});
  const auto lost = std::ranges::count_if(scan.ranges, [](float r) { return std::isnan(r); });
  EXPECT_NEAR(static_cast<double>(lost), 500.0, 80.0);
}

TEST(LidarBuilding, AStartWhereItsBodyDoesNotFitIsRefusedWithTheNearestOne) {
  const OccupancyGrid floor = hall();
  const auto world = robot("radius=0.3");
  try {
    world->begin({.floor = &floor, .pose = Pose2(0.5, 3.0, 0.0)});
    FAIL() << "it starts in a wall";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr("in a wall"));
    EXPECT_THAT(error.what(), HasSubstr("(1.500, 2.500)"));
  }
  EXPECT_THROW(world->begin({}), Error);
  EXPECT_NO_THROW(world->begin({.floor = &floor}));  // it chooses
}

}  // namespace
}  // namespace cairn
