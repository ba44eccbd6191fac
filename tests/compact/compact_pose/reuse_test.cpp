// SPDX-License-Identifier: BSD-3-Clause
// Relocation: a pose that a link leads to a kept one is not kept itself, and the way goes on from
// there.
#include <algorithm>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/normalized_error.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using test::all_ids;
using test::PolicyRun;
using test::run;
using test::simulate;
using testing::Lt;

class Reuse : public testing::Test {
 protected:
  PolicyRun drive(const std::string& world, const std::string& policy,
                  const std::string& registration, std::uint64_t seed = 5) {
    simulation_ = simulate(registry, world, seed);
    return run(registry, simulation_, policy, registration);
  }
  Registry registry;
  Simulation simulation_;
};

const std::string kLaps = "ellipse_n:poses_per_lap=40,loop_density=0,laps=";
const std::string kSensor = "simulated:range=4,angle=0.4";
const std::string kPolicy = "compact_pose:range=4,angle=0.4,reuse=";

TEST_F(Reuse, TheMapOfAPlaceStopsGrowing) {
  std::vector<std::size_t> kept, factors;
  for (const std::string laps : {"3", "40", "160"}) {
    const PolicyRun some = drive(kLaps + laps, kPolicy + "true", kSensor);
    kept.push_back(some.policy->kept().size());
    factors.push_back(static_cast<std::size_t>(some.policy->factor_count()));
  }
  EXPECT_LE(kept[2], kept[0] + 8);
  EXPECT_LE(kept[2], kept[1] + 2);
  // A way between the same two poses is one factor, however often it is gone.
  EXPECT_LT(factors[2], 6 * kept[2]);
  EXPECT_GT(drive(kLaps + "12", kPolicy + "false", kSensor).policy->kept().size(), 4 * kept[1]);
}

TEST_F(Reuse, IsOffUnlessAskedFor) {
  const auto kept = [&](const std::string& policy) {
    return drive(kLaps + "6", policy, kSensor).kept();
  };
  const auto by_default = kept("compact_pose:range=4,angle=0.4");
  EXPECT_EQ(by_default, kept(kPolicy + "false"));
  EXPECT_GT(by_default.size(), 2 * kept(kPolicy + "true").size());
}

/// Whatever a match is worth beside a step of odometry (0.02 m, 0.005 rad), with nothing said of
/// it: it is learnt from those that come back.
TEST_F(Reuse, TheMapStopsGrowingWhateverAMatchIsWorth) {
  for (const double ratio : {0.5, 1.0, 1.5, 2.5, 5.0}) {
    const std::string sigmas = ",sigma_translation=" + std::to_string(0.02 * ratio) +
                               ",sigma_rotation=" + std::to_string(0.005 * ratio);
    std::vector<std::size_t> kept;
    for (const int laps : {25, 100}) {
      const PolicyRun some = drive(
          "ellipse_n:poses_per_lap=40,loop_density=0,translation_error=0,rotation_error=0,"
          "translation_sigma=0.02,rotation_sigma=0.005,laps=" +
              std::to_string(laps),
          "compact_pose:range=5,angle=0.5,reuse=true", "simulated:range=5,angle=0.5" + sigmas);
      kept.push_back(some.policy->kept().size());
      std::int64_t asked = 0;
      for (const PoseReport& report : some.reports) asked += std::ssize(report.links);
      EXPECT_LT(asked, 2 * 40 * laps) << ratio;
    }
    EXPECT_LT(kept[0], 80U) << ratio;
    EXPECT_LE(kept[1], kept[0] + 15) << ratio;
  }
}

TEST_F(Reuse, WithoutNoiseTheMapIsTheTruth) {
  const PolicyRun one = drive(
      "ellipse_n:poses_per_lap=40,laps=6,loop_density=0,translation_sigma=1e-6,rotation_sigma=1e-6,"
      "translation_error=0,rotation_error=0",
      kPolicy + "true,sensor=0.00001 0.00001",
      "simulated:range=4,angle=0.4,"
      "sigma_translation=0.000001,sigma_rotation=0.000001");
  EXPECT_THAT(one.kept().size(), Lt(100U));
  for (const Recovery how : {Recovery::distribute, Recovery::likely}) {
    const TrajectoryError error =
        compare(trajectory(recovered_trajectory(*one.policy, how)), trajectory(simulation_.truth));
    EXPECT_EQ(error.poses, 240);
    EXPECT_LT(error.ate_translation, 1e-4);
    EXPECT_LT(error.rpe_translation, 1e-4);
  }
}

/// Where a loop closure is as uncertain as odometry, half of it is a loss: such a pose is kept, as
/// long as few others are nearby.
TEST_F(Reuse, WhereItCostsMuchAPoseIsKept) {
  const auto kept = [&](const std::string& loss, const std::string& sigma) {
    const std::string sensor = ",sigma_translation=" + sigma + ",sigma_rotation=" + sigma;
    return drive(kLaps + "4", kPolicy + "true,sensor=0.05 0.05,reuse_loss=" + loss,
                 kSensor + sensor)
        .kept()
        .size();
  };
  EXPECT_GT(kept("0", "0.05"), kept("10", "0.05"));
  EXPECT_GE(kept("0", "0.05"), kept("0.06", "0.05"));
  // Nearly exact ones cost next to nothing.
  EXPECT_EQ(kept("0.001", "0.0001"), kept("10", "0.0001"));
}

TEST_F(Reuse, EveryPoseComesBackOnce) {
  const PolicyRun one = drive("manhattan:poses=400,streets=4,loop_density=0",
                              "compact_pose:range=3,angle=3.15,reuse=true", "simulated:range=3");
  EXPECT_LT(one.policy->kept().size(), 250U);
  const Graph way = recovered_trajectory(*one.policy, Recovery::likely);
  const std::vector<Id> all = all_ids(simulation_.graph);
  EXPECT_EQ(way.variable_count(), static_cast<int>(all.size()));
  for (const Id id : all) EXPECT_TRUE(way.find(id)) << id;
  const Graph compact = one.policy->estimator().graph();
  for (int v = 0; v < compact.variable_count(); ++v) {
    const auto there = way.state(*way.find(compact.id(v)));
    EXPECT_TRUE(std::ranges::equal(there, compact.state(v))) << compact.id(v);
  }
}

/// Each measurement is split in two halves of its information, and halves that are the same number
/// are taken for independent: that must not make the map overconfident.
TEST_F(Reuse, IsHonestOverManyRuns) {
  double squared = 0.0, dof = 0.0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const PolicyRun one =
        drive(kLaps + "6", kPolicy + "true", kSensor + ",seed=" + std::to_string(seed), seed);
    const NormalizedError error =
        normalized_error(one.policy->estimator().graph(), simulation_.truth);
    squared += error.squared;
    dof += error.dof;
  }
  EXPECT_LT(squared / dof, 1.0 + 1.96 * std::sqrt(2.0 / dof));
  EXPECT_GT(squared / dof, 0.3);
}

TEST_F(Reuse, TheEstimateIsNotWorseThanOdometryMakesIt) {
  const PolicyRun with = drive(kLaps + "10", kPolicy + "true", kSensor);
  const double error = compare(trajectory(recovered_trajectory(*with.policy, Recovery::likely)),
                               trajectory(simulation_.truth))
                           .ate_translation;
  const double odometry =
      compare(trajectory(simulation_.graph), trajectory(simulation_.truth)).ate_translation;
  EXPECT_LT(error, 0.2 * odometry);
}

TEST(ReadingAPolicy, ChangesNoLaterResult) {
  Registry registry;
  const Simulation world = simulate(registry, "manhattan:poses=250");
  const auto end_of = [&](bool read) {
    const auto policy = registry.make<PosePolicy>("compact_pose:range=3,angle=0.8,reuse=true");
    const auto registration = registry.make<Registration>("recorded");
    registration->begin({.recording = &world.graph, .truth = &world.truth});
    int reads = 0;
    const std::vector<Arrival> poses = pose_chain(world.graph);
    run_policy(world.graph, poses, *policy, *registration, [&](const PoseReport& report) {
      if (!read || report.id % 3 != 0) return true;
      Estimator& estimator = policy->estimator();
      for (const Id id : policy->kept()) estimator.state(id);
      estimator.chi2();
      std::vector<double> block(9);
      estimator.covariance(policy->kept().front(), policy->kept().back(), block);
      ++reads;
      return true;
    });
    EXPECT_EQ(reads > 0, read);
    return policy->estimator().graph();
  };
  const Graph quiet = end_of(false), asked = end_of(true);
  ASSERT_EQ(quiet.variable_count(), asked.variable_count());
  ASSERT_GT(quiet.variable_count(), 30);
  ASSERT_GT(quiet.factor_count(), quiet.variable_count());
  for (int v = 0; v < quiet.variable_count(); ++v) {
    EXPECT_EQ(quiet.id(v), asked.id(v));
    EXPECT_TRUE(std::ranges::equal(quiet.state(v), asked.state(v))) << quiet.describe_variable(v);
  }
}

}  // namespace
}  // namespace cairn::compact
