// SPDX-License-Identifier: BSD-3-Clause
// The world `log`: a recorded run through the same front end.
#include <stdlib.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/recorded_world.hpp"
#include "cairn/exploration/scan_log.hpp"
#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/support/exploration_runs.hpp"

namespace cairn {
namespace {

using test::ExplorationParts;
using testing::HasSubstr;

/// A folder of its own, as long as it lives.
class Folder {
 public:
  Folder() : path_((std::filesystem::temp_directory_path() / "cairn-log-XXXXXX").string()) {
    if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("no temporary folder");
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// Decides nothing, and must not be asked.
class Unasked final : public Explorer {
 public:
  void begin(std::uint64_t) override {}
  Decision decide(const Situation&) override {
    ADD_FAILURE() << "a recorded robot was asked where to go";
    return {};
  }
};

/// It keeps all, so that no gain is near a threshold.
constexpr const char* kPolicy = "compact_pose:range=1,angle=0.35,reuse=false,strategy=apal";

class LogWorldTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Registry().has("scan_log", "carmen")) GTEST_SKIP() << "without carmen";
    floor_ = test::floor_named("rooms:width=10,height=8", 2);
    ExplorationParts parts(test::kNoisyRobot);
    parts.policy = parts.make<PosePolicy>(kPolicy);
    Exploration exploration = parts.on(floor_, 5);
    exploration.limits.distance = 9.0;  // further on a match depends on a millimetre of its guess
    exploration.log = &log_;
    run_ = run_exploration(exploration);
    file_ = folder_.file("run.clf.gz");
    Registry registry;
    write_scan_log(log_, file_, registry);
  }
  std::string named(const std::string& more) const { return "log:file=" + file_ + more; }

  Folder folder_;
  OccupancyGrid floor_;
  ScanLog log_;
  ExplorationResult run_;
  std::string file_;
};

TEST_F(LogWorldTest, TheRobotGoesWhereItWent) {
  Registry registry;
  const auto world = registry.make<World>(parse_component(named(",step=0")));
  auto* recorded = query<RecordedWorld>(*world);
  ASSERT_NE(recorded, nullptr);
  EXPECT_EQ(world->robot().lidar.beams, 181);
  EXPECT_EQ(world->robot().lidar.range, 8.0);
  const LaserScan first = world->begin({});
  EXPECT_EQ(first.ranges, log_.scans.front().scan.ranges);
  for (std::size_t k = 1; k < log_.scans.size(); ++k) {
    ASSERT_FALSE(recorded->has_ended());
    const WorldStep step = world->move(Pose2(5.0, 5.0, 1.0));
    const Pose2 odometry = log_.scans[k - 1].odometry.between(log_.scans[k].odometry);
    EXPECT_LT((step.odometry.state() - odometry.state()).norm(), 1e-12);
    EXPECT_EQ(step.scan.ranges, log_.scans[k].scan.ranges);
    ASSERT_TRUE(world->truth());
    const Pose2 truth = *run_.start * *run_.steps[k].truth;
    EXPECT_LT(truth.local(*world->truth()).norm(), 1e-9);
  }
  EXPECT_TRUE(recorded->has_ended());
  EXPECT_THROW(world->move(Pose2()), Error);
  world->begin({});
  EXPECT_FALSE(recorded->has_ended());
}

/// Its estimate and its map are those of the run, but for the motion after which the policy expects
/// the next pose, and it is compared with the floor.
TEST_F(LogWorldTest, ARunOfItHasTheSameMapAndAsksNoExplorer) {
  ExplorationParts parts(named(",step=0,relative=0.05"));
  parts.policy = parts.make<PosePolicy>(kPolicy);
  parts.explorer = std::make_unique<Unasked>();
  const ExplorationResult again = run_exploration(parts.on(floor_, 5));
  EXPECT_EQ(again.end, ExplorationEnd::finished);
  EXPECT_THAT(again.why, HasSubstr("recording is at its end"));
  ASSERT_EQ(again.steps.size(), run_.steps.size());
  EXPECT_TRUE(again.decision_seconds.empty());
  EXPECT_NEAR(again.steps.back().distance, run_.steps.back().distance, 1e-9);
  ASSERT_TRUE(again.against);
  EXPECT_NEAR(again.against->seen, run_.against->seen, 0.01 * run_.against->floor);
  for (std::size_t k = 0; k < again.steps.size(); ++k) {
    const Pose2 apart = again.steps[k].estimate.between(run_.steps[k].estimate);
    EXPECT_LT(apart.translation().norm(), 0.02);  // odometry is off by ten times as much
    EXPECT_LT(again.steps[k].truth->local(*run_.steps[k].truth).norm(), 1e-9);
  }
}

TEST_F(LogWorldTest, ScansAreTakenAfterAStepOrATurn) {
  ExplorationParts parts(named(",step=1,turn=3.2"));
  parts.explorer = std::make_unique<Unasked>();
  Exploration exploration = parts.on(floor_);
  exploration.start.floor = nullptr;
  const ExplorationResult coarse = run_exploration(exploration);
  EXPECT_LT(coarse.steps.size(), run_.steps.size() / 2);
  EXPECT_GT(coarse.steps.size(), 6U);
  EXPECT_FALSE(coarse.against);
  // By odometry, which is off by hundredths of a motion.
  for (std::size_t k = 1; k < coarse.steps.size(); ++k)
    EXPECT_GE(coarse.steps[k].distance - coarse.steps[k - 1].distance, 0.9);
  ExplorationParts others(named(""));
  Exploration short_run = others.on(floor_);
  short_run.limits.steps = 3;
  EXPECT_EQ(run_exploration(short_run).end, ExplorationEnd::limit);
}

/// True poses of some scans alone: the map is compared with the floor once three determine how the
/// two lie, and from the first of them.
TEST_F(LogWorldTest, TruePosesMayBeFewOrBeginLate) {
  Registry registry;
  if (!registry.has("registration", "icp")) GTEST_SKIP() << "without icp";
  const auto run_with = [&](std::size_t first, std::size_t last) {
    ScanLog log = log_;
    for (std::size_t k = 0; k < log.scans.size(); ++k) {
      if (k < first || k > last) log.scans[k].truth.reset();
    }
    write_scan_log(log, file_, registry);
    ExplorationParts parts(named(",step=0,relative=0.05"));
    parts.registration = parts.make<Registration>("icp");
    Exploration exploration = parts.on(floor_, 5);
    exploration.match_consecutive = true;
    return run_exploration(exploration);
  };
  const std::size_t end = log_.scans.size() - 1;
  for (const std::size_t only : {std::size_t{0}, end - 1, end})
    EXPECT_FALSE(run_with(only, only).against) << only;
  EXPECT_FALSE(run_with(end - 1, end).against);
  const ExplorationResult late = run_with(6, end), middle = run_with(6, end - 3);
  for (const ExplorationResult* run : {&late, &middle}) {
    ASSERT_TRUE(run->against);
    EXPECT_EQ(run->against->floor, run_.against->floor);
    EXPECT_NEAR(run->against->seen, run_.against->seen, 0.02 * run_.against->floor);
  }
}

TEST_F(LogWorldTest, SaysWhatIsWrongWithALog) {
  Registry registry;
  const auto refusal = [&](const std::string& name) -> std::string {
    try {
      static_cast<void>(registry.make<World>(parse_component(name))->robot());
    } catch (const Error& error) {
      return error.what();
    }
    return "made";
  };
  EXPECT_THAT(refusal("log"), HasSubstr("log:file=robot.clf"));
  EXPECT_THAT(refusal("log:file=" + folder_.file("none.clf")), HasSubstr("none.clf"));
  EXPECT_THAT(refusal("log:file=robot.bag"), HasSubstr(".clf"));
  const std::string empty = folder_.file("empty.clf"), blind = folder_.file("blind.clf");
  write_file(empty, "ODOM 1 2 3 0 0 0 0 h 0\n");
  write_file(blind, "FLASER 3 90 90 90 0 0 0 0 0 0 1 h 1\n");
  EXPECT_THAT(refusal("log:file=" + empty), HasSubstr("no line begins with FLASER"));
  EXPECT_THAT(refusal("log:file=" + blind), HasSubstr("blind.clf: no range of the 1 scans"));
}

}  // namespace
}  // namespace cairn
