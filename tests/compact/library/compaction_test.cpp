// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/compaction.hpp"

#include <atomic>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "compact/support/policy_runs.hpp"

namespace cairn {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

class Compactions : public testing::Test {
 protected:
  PolicyData recorded(const std::string& generator) {
    Simulation world = test::simulate(registry, generator);
    return policy_data(std::move(world.graph), std::move(world.truth));
  }
  CompactionJob job(const std::string& policy = "compact_pose") {
    return {.job = {.policy = parse_component(policy)}};
  }
  Compaction compact(const CompactionJob& job) {
    const PolicySetting setting{.data = data, .registry = registry};
    return compact_recording(job, data, setting, {.note = [&](const std::string& sentence) {
                               notes.push_back(sentence);
                             }});
  }

  Registry registry;
  PolicyData data = recorded("manhattan:poses=300,streets=5");
  std::vector<std::string> notes;
};

TEST_F(Compactions, ARecordingKeepsAllOfItsMeasurementsInFewPoses) {
  const Compaction made = compact(job());
  EXPECT_EQ(made.strategy, "whole");
  ASSERT_TRUE(made.whole.has_value());
  EXPECT_LT(made.result.kept_poses, 200);
  EXPECT_EQ(made.result.kept_loops, data.loops);
  EXPECT_GT(made.found.seconds, 0.0);
  EXPECT_LT(made.check->distance, 1e-6);
  // The compact graph by itself is that map.
  Graph alone = made.result.compact.clone();
  const auto optimizer = registry.make<Optimizer>("levenberg_marquardt");
  ASSERT_EQ(optimizer->optimize(alone).status, Status::converged);
  EXPECT_LT(absolute_error(trajectory(alone), trajectory(made.result.trajectory)), 1e-5);
  EXPECT_THAT(notes, IsEmpty());
}

TEST_F(Compactions, ARobotsWayGoesByItsName) {
  CompactionJob few = job("compact_pose:range=3");
  few.strategy = "fpfl";
  few.keep = 40;
  const Compaction made = compact(few);
  EXPECT_EQ(made.strategy, "fpfl");
  EXPECT_FALSE(made.whole.has_value());
  EXPECT_EQ(made.found.seconds, 0.0);  // a threshold is given
  EXPECT_LE(made.result.kept_poses, 40);
  EXPECT_EQ(made.job.policy.values.at("strategy"), "fpfl");
  EXPECT_GT(made.check->distance, 0.0);
}

TEST_F(Compactions, WhatContradictsTheOthersLeavesTheRecording) {
  data = recorded("manhattan:poses=300,streets=5,outliers=20");
  const std::int64_t loops = data.loops;
  const Compaction made = compact(job());
  EXPECT_EQ(made.strategy, "whole");
  EXPECT_GT(made.loops_left_out, 0);
  EXPECT_EQ(std::ssize(made.left_out), made.loops_left_out);
  EXPECT_EQ(data.loops, loops - made.loops_left_out);
  EXPECT_THAT(notes, Contains(HasSubstr("contradict the others")));
}

TEST_F(Compactions, StrategiesThatContradictEachOtherAreRefused) {
  const auto refused = [&](CompactionJob job, const std::string& strategy) {
    job.strategy = strategy;
    try {
      compact(job);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refused(job("compact_pose:strategy=apal"), "apfl"), HasSubstr("give one"));
  EXPECT_THAT(refused(job(), "wole"), HasSubstr("whole"));
  EXPECT_THAT(refused(job("random_poses:poses=10"), "fpfl"), HasSubstr("has no strategies"));
  CompactionJob continued = job();
  continued.map = &data.recording;
  EXPECT_THAT(refused(continued, "whole"), HasSubstr("continues a map"));
  CompactionJob twice = job("compact_pose:keep=10,range=3");
  twice.keep = 12;
  EXPECT_THAT(refused(twice, "fpfl"), HasSubstr("poses to keep"));
}

TEST_F(Compactions, AnInterruptLeavesNothingSelected) {
  const std::atomic<bool> interrupt = true;
  const PolicySetting setting{.data = data, .registry = registry, .interrupt = &interrupt};
  const Compaction made = compact_recording(job(), data, setting);
  EXPECT_TRUE(made.result.interrupted);
  EXPECT_THAT(made.result.poses, IsEmpty());
}

}  // namespace
}  // namespace cairn
