// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/selection_check.hpp"

#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/policy/threshold_search.hpp"
#include "compact/support/policy_runs.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Key;
using ::testing::Pair;
using ::testing::SizeIs;

/// What is advised is followed, and must help.
class SelectionChecks : public ::testing::Test {
 protected:
  struct Outcome {
    std::size_t kept = 0, links = 0;
    std::vector<SelectionCheck::Advice> advice;
  };
  Outcome run(OptionValues options, std::optional<std::int64_t> loops = 100) {
    for (const auto& [name, value] : common_) options.emplace(name, value);
    ComponentSpec spec{"compact_pose", options};
    const auto registration = registry_.make<Registration>(matcher_);
    registration->begin({.recording = &world_.graph, .truth = &world_.truth});
    FunctionRegistration shifted([&](Id earlier, Id later) {
      std::vector<Factor> match = registration->match(earlier, later);
      std::mt19937_64 random(static_cast<std::uint64_t>(1009 * earlier + later));
      std::uniform_real_distribution<double> any(0.5, 1.0);
      const double where = random() % 2 == 0 ? any(random) : -any(random);
      for (Factor& factor : match) factor.measurement[0] += shift_ * where;
      return match;
    });
    const test::PolicyRun run = test::run(registry_.make<PosePolicy>(spec), shifted, world_.graph);
    SelectionCheck check;
    for (const PoseReport& report : run.reports) check.add(report);
    EXPECT_EQ(check.poses(), 200);
    return {run.kept().size(), run.links().size(), check.advice(nullptr, loops)};
  }
  Outcome follow(OptionValues options, const SelectionCheck::Advice& advice) {
    for (const auto& [name, value] : advice.options) options.insert_or_assign(name, value);
    return run(options);
  }
  Registry registry_;
  Simulation world_ = test::simulate(registry_, "manhattan:poses=200,streets=4");
  double shift_ = 0.0;  ///< of a match along x, at most and at least half of it [m]
  std::string matcher_ = "simulated:range=3,angle=3.14";
  OptionValues common_{{"range", "4"}, {"angle", "3.15"}};
};

TEST_F(SelectionChecks, ACompactGraphNeedsNoAdvice) {
  const Outcome good = run({});
  EXPECT_LT(good.kept, 150U);
  EXPECT_GT(good.links, 0U);
  EXPECT_THAT(good.advice, IsEmpty());
}

TEST_F(SelectionChecks, AThresholdBelowEveryStepOfOdometryIsRaised) {
  const OptionValues options{{"pose_gain", "0.5"}, {"loop_gain", "8"}};
  const Outcome all = run(options);
  EXPECT_GT(all.kept, 180U);
  ASSERT_THAT(all.advice, ElementsAre(::testing::Field(&SelectionCheck::Advice::options,
                                                       ElementsAre(Key("pose_gain")))));
  EXPECT_THAT(all.advice[0].finding, HasSubstr("more than pose_gain"));
  EXPECT_LT(follow(options, all.advice[0]).kept, 100U);
  EXPECT_THAT(to_string(all.advice[0]), HasSubstr("; pose_gain="));
}

TEST_F(SelectionChecks, ASensorThatReachesNoFurtherThanAStepIsNamed) {
  const Outcome all = run({{"range", "0.01"}, {"angle", "0.01"}, {"wide", "false"}});
  EXPECT_EQ(all.kept, 200U);
  ASSERT_THAT(all.advice, SizeIs(2));
  EXPECT_THAT(all.advice[0].finding, HasSubstr("out of the sensor's range"));
  EXPECT_THAT(to_string(all.advice[0]), HasSubstr("a larger angle and a larger range"));
  EXPECT_THAT(all.advice[1].finding, HasSubstr("no pose is within the sensor's range"));
}

TEST_F(SelectionChecks, PosesThatStayForTheirLoopClosuresAreRelocated) {
  world_ = test::simulate(registry_, "ellipse_n:laps=5,poses_per_lap=40");
  matcher_ = "simulated:range=1.5,angle=1";
  const OptionValues options{{"loop_gain", "0"}, {"reuse", "false"}, {"pose_gain", "1.5"}};
  const Outcome all = run(options);
  ASSERT_GE(all.kept, 180U);
  ASSERT_THAT(all.advice, SizeIs(1));
  EXPECT_THAT(all.advice[0].options,
              AllOf(Contains(Pair("reuse", "true")), Contains(Key("loop_gain"))));
  const Outcome fewer = follow(options, all.advice[0]);
  EXPECT_LT(fewer.kept, 180U);
  EXPECT_LT(fewer.links, all.links);
  EXPECT_GT(fewer.links, 0U);
}

TEST_F(SelectionChecks, AThresholdAboveEveryExpectedGainIsLowered) {
  const OptionValues options{{"loop_gain", "1000"}};
  const Outcome none = run(options);
  EXPECT_EQ(none.links, 0U);
  ASSERT_THAT(none.advice, SizeIs(1));
  EXPECT_THAT(none.advice[0].finding, HasSubstr("none has an expected information gain above"));
  EXPECT_GT(follow(options, none.advice[0]).links, 0U);
}

TEST_F(SelectionChecks, MatchesThatAreLessAccurateThanExpectedLowerTheThreshold) {
  matcher_ += ",sigma_translation=2,sigma_rotation=1";
  const OptionValues options{{"sensor", "0.02 0.01"}, {"loop_gain", "4"}, {"reuse", "false"}};
  const Outcome none = run(options);
  EXPECT_EQ(none.links, 0U);
  ASSERT_THAT(none.advice, SizeIs(1));
  EXPECT_THAT(none.advice[0].finding, HasSubstr("have an information gain below loop_gain"));
  EXPECT_GT(follow(options, none.advice[0]).links, 0U);
}

TEST_F(SelectionChecks, WhatMatchesNothingIsNamed) {
  matcher_ += ",failure_rate=1";
  const Outcome none = run({});
  ASSERT_THAT(none.advice, SizeIs(1));
  EXPECT_THAT(none.advice[0].finding, HasSubstr("that were asked for matched; the recording's"));
  // Live, the front end knows why; a recording without loop closures has none to use.
  EXPECT_THAT(run({}, {}).advice, SizeIs(1));
  EXPECT_THAT(run({}, 0).advice, IsEmpty());
}

TEST_F(SelectionChecks, MatchesThatContradictTheEstimateAreNamed) {
  shift_ = 20.0;
  const Outcome none = run({{"gate", "0.99"}});
  EXPECT_EQ(none.links, 0U);
  ASSERT_THAT(none.advice, SizeIs(1));
  EXPECT_THAT(none.advice[0].finding, HasSubstr("matches contradict the estimate"));
  EXPECT_THAT(none.advice[0].options, ElementsAre(Pair("gate", "0")));
  EXPECT_GT(follow({{"gate", "0.99"}}, none.advice[0]).links, 0U);
}

TEST_F(SelectionChecks, MatchesThatNoOtherCanConfirmAreNamed) {
  const OptionValues doubtful{{"gate", "0.99"}, {"trust", "1e-9"}};
  const Outcome none = run(doubtful);
  EXPECT_EQ(none.links, 0U);
  ASSERT_THAT(none.advice, SizeIs(1));
  EXPECT_THAT(none.advice[0].finding, HasSubstr("wait for another that agrees"));
  EXPECT_THAT(none.advice[0].options, ElementsAre(Pair("trust", "1")));
  EXPECT_GT(follow(doubtful, none.advice[0]).links, 0U);
}

/// By hand
/// -----------------------------------------------------------------------------------------

SelectionCheck everything_kept(int poses) {
  SelectionCheck check;
  for (int k = 0; k < poses; ++k) {
    PoseReport report;
    report.kept = true;
    report.least_gain = 1.0;
    report.candidates = 1;
    check.add(report);
  }
  return check;
}

TEST(SelectionCheck, AFewPosesShowNothing) {
  EXPECT_THAT(everything_kept(9).advice(), IsEmpty());
  EXPECT_THAT(everything_kept(10).advice(), SizeIs(1));
}

TEST(SelectionCheck, PosesThatStayForTheirLandmarksRaiseTheThresholdOfThese) {
  SelectionCheck check;
  for (int k = 0; k < 40; ++k) {
    PoseReport pose;
    pose.kept = k % 10 != 9;
    pose.landmarks = {{.added = true, .gain = 1e9, .verdict = LinkVerdict::linked},
                      {.gain = 0.5, .verdict = LinkVerdict::uninformative}};
    if (pose.kept) {
      pose.landmarks.push_back({.gain = 1.0 + 0.1 * (k % 10), .verdict = LinkVerdict::linked});
      pose.landmarks.push_back({.gain = 0.9, .verdict = LinkVerdict::linked});
    }
    check.add(pose);
  }
  const auto advice = check.advice(nullptr, 0);
  ASSERT_THAT(advice, SizeIs(1));
  EXPECT_THAT(advice.front().finding, HasSubstr("measurement of a landmark"));
  // The mean of the largest of each but the first pose, which is kept in any case.
  const double mean = (4 * (9 + 0.1 * 36) - 1.0) / 35;
  EXPECT_NEAR(std::stod(advice.front().options.at("landmark_gain")), mean, 0.006);
}

TEST(SelectionCheck, WhereASearchKeptAllTheSmallerTrialWithTheLeastErrorIsAdvised) {
  FoundThresholds found;
  found.tolerance = 2.0;
  const auto trial = [](double error, int poses, const char* loop_gain, const char* pose_gain) {
    return ThresholdTrial{
        .realised = error,
        .poses_kept = poses,
        .options = {{"range", "3"}, {"loop_gain", loop_gain}, {"pose_gain", pose_gain}}};
  };
  found.trials = {trial(9.0, 20, "7", "2.36"), trial(5.0, 30, "3.49999", "2.36"),
                  trial(3.0, 60, "1", "0.5")};
  found.chosen = 2;
  found.options = found.trials.back().options;
  const std::vector<SelectionCheck::Advice> advice = everything_kept(100).advice(&found);
  ASSERT_THAT(advice, SizeIs(1));
  EXPECT_THAT(advice[0].finding, AllOf(HasSubstr("30 poses"), HasSubstr("instead of 60"),
                                       HasSubstr("5 m"), HasSubstr("2 m")));
  EXPECT_THAT(advice[0].options, ElementsAre(Pair("loop_gain", "3.5"), Pair("pose_gain", "2.36")));
  // Of a search without a smaller trial, the reason is in the poses.
  found.trials.erase(found.trials.begin(), found.trials.begin() + 2);
  found.chosen = 0;
  EXPECT_THAT(everything_kept(100).advice(&found)[0].options, ElementsAre(Key("pose_gain")));
}

}  // namespace
}  // namespace cairn
