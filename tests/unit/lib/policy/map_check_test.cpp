// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/map_check.hpp"

#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/io/generator.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

class MapCheckOf : public ::testing::Test {
 protected:
  void SetUp() override {
    Simulation world = registry_.make<Generator>("manhattan:poses=200")->generate(registry_, 3);
    data_ = policy_data(std::move(world.graph));
  }
  PolicyResult run(const std::string& policy) {
    PolicyRun run({.policy = parse_component(policy)}, setting_);
    run.run(data_.poses.size(), "run");
    return run.finish(Recovery::distribute);
  }

  PolicyJob job_{.policy = {}};  // what it is checked by: its registration
  Registry registry_;
  PolicyData data_;
  PolicySetting setting_{.data = data_, .registry = registry_};
};

TEST_F(MapCheckOf, EverythingIsNowhereFar) {
  const auto check =
      check_map(job_, run("compact_pose:strategy=apal,range=100,angle=3.15"), setting_);
  ASSERT_TRUE(check);
  EXPECT_LT(check->distance, 1e-6);
  EXPECT_FALSE(check->is_far());
}

/// Without a loop closure the map is dead reckoning; the other map is that of another program path.
TEST_F(MapCheckOf, OdometryAloneIsItsDistance) {
  const PolicyResult alone = run("compact_pose:loop_gain=1e6,pose_gain=0");
  ASSERT_EQ(alone.kept_loops, 0);
  const auto check = check_map(job_, alone, setting_);
  ASSERT_TRUE(check);
  const PolicyResult all = run("compact_pose:strategy=apal,range=100,angle=3.15");
  EXPECT_NEAR(check->distance,
              absolute_error(trajectory(alone.trajectory), trajectory(all.trajectory)), 1e-6);
  EXPECT_GT(check->distance, 0.05);
  EXPECT_GT(check->extent, 10.0 * check->distance);
  EXPECT_THAT(check->to_string(), HasSubstr(" m from the map of all measurements, "));
  EXPECT_EQ(check->is_far(), check->distance > 0.005 * check->extent);
}

/// Measurements that contradict each other make no map to compare with.
TEST_F(MapCheckOf, MeasurementsThatContradictEachOtherTellNothing) {
  Simulation world =
      registry_.make<Generator>("manhattan:poses=200,outliers=10")->generate(registry_, 3);
  data_ = policy_data(std::move(world.graph));
  EXPECT_FALSE(check_map(job_, run("compact_pose:range=100,angle=3.15,loop_gain=1e6,pose_gain=0"),
                         setting_));
  const PolicyResult gated = run("compact_pose:range=100,angle=3.15,gate=0.99");
  ASSERT_TRUE(gated.verdicts.contains("inconsistent"));
  EXPECT_FALSE(check_map(job_, gated, setting_));
}

TEST_F(MapCheckOf, NothingIsCheckedOfAnInterruptedRunOrOtherMatches) {
  PolicyResult result = run("compact_pose:range=5");
  EXPECT_TRUE(check_map({.policy = {}, .registration = "recorded:carry=0"}, result, setting_));
  EXPECT_FALSE(check_map({.policy = {}, .registration = "simulated:range=5"}, result, setting_));
  result.interrupted = true;
  EXPECT_FALSE(check_map(job_, result, setting_));
}

}  // namespace
}  // namespace cairn
