// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/threshold_search.hpp"

#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/io/generator.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

/// Writes the factors into the options, so that it is seen which were chosen.
class Factors final : public OptionFinder {
 public:
  OptionValues watching(bool) const override { return {}; }
  OptionValues found() const override { return {{"loop_gain", "1"}}; }
  OptionValues scaled(const OptionValues& found, double links, double poses) const override {
    EXPECT_EQ(found.at("loop_gain"), "first");
    return {{"loop_gain", std::to_string(links)}, {"pose_gain", std::to_string(poses)}};
  }
  double accuracy() const override { return 0.0; }
};

/// A world whose error and number of loops are functions of the factors.
class RefineThresholds : public ::testing::Test {
 protected:
  using World = std::function<std::pair<double, int>(double links, double poses)>;
  FoundThresholds refine(double tolerance, const World& world, int stop_after = 1000) {
    FoundThresholds found;
    found.options = {{"loop_gain", "first"}};
    found.tolerance = tolerance;
    const auto test = [&](const OptionValues& options, double links, double poses) {
      EXPECT_EQ(options.at("loop_gain"), std::to_string(links));
      const auto [error, loops] = world(links, poses);
      return ThresholdTrial{.links = links, .poses = poses, .expected = error, .loops_kept = loops};
    };
    refine_thresholds(Factors(), test, found,
                      [&] { return std::ssize(found.trials) >= stop_after; });
    return found;
  }
  static OptionValues chosen(double links, double poses) {
    return {{"loop_gain", std::to_string(links)}, {"pose_gain", std::to_string(poses)}};
  }
  static std::vector<std::pair<double, double>> tried(const FoundThresholds& found) {
    std::vector<std::pair<double, double>> all;
    for (const ThresholdTrial& trial : found.trials) all.emplace_back(trial.links, trial.poses);
    return all;
  }
  static auto near(double links, double poses) {
    return Pair(::testing::DoubleNear(links, 1e-9), ::testing::DoubleNear(poses, 1e-9));
  }
  const double root_ = std::sqrt(0.5);
};

TEST_F(RefineThresholds, IsContentWithWhatIsGoodAtOnce) {
  const FoundThresholds found = refine(1.0, [](double, double) { return std::pair(1.0, 5); });
  EXPECT_THAT(tried(found), ElementsAre(near(1.0, 1.0)));
  EXPECT_EQ(found.options, chosen(1.0, 1.0));
}

TEST_F(RefineThresholds, LowersTheGainOfLinksUntilTheErrorIsSmallEnough) {
  const FoundThresholds found =
      refine(0.3, [](double links, double) { return std::pair(links, int(100.0 / links)); });
  EXPECT_THAT(tried(found), ElementsAre(near(1.0, 1.0), near(root_, 1.0), near(0.5, 1.0),
                                        near(0.5 * root_, 1.0), near(0.25, 1.0)));
  EXPECT_EQ(found.options, chosen(0.25, 1.0));
}

/// No link at all is no sign that all have been let through.
TEST_F(RefineThresholds, LowersTheGainOfLinksUntilThereIsOne) {
  const FoundThresholds found = refine(0.4, [](double links, double) {
    return links < 0.2 ? std::pair(0.3, 2) : std::pair(1.0, 0);
  });
  EXPECT_THAT(found.trials, SizeIs(6));
  EXPECT_EQ(found.options, chosen(found.trials.back().links, 1.0));
}

TEST_F(RefineThresholds, LowersTheGainOfPosesWhereNoMoreLinksCome) {
  const FoundThresholds found =
      refine(0.4, [](double, double poses) { return std::pair(poses, 7); });
  EXPECT_THAT(tried(found),
              ElementsAre(near(1.0, 1.0), near(root_, 1.0), near(0.5, 1.0), near(root_, root_),
                          near(0.5, 0.5), near(0.5 * root_, 0.5 * root_)));
  EXPECT_EQ(found.options, chosen(0.5 * root_, 0.5 * root_));
}

TEST_F(RefineThresholds, KeepsTheLeastErrorWhereNothingIsGood) {
  const FoundThresholds found = refine(0.5, [](double links, double poses) {
    return std::pair(1.0 + std::abs(std::log2(links) + 2.0) + 2.0 * std::abs(std::log2(poses)),
                     int(100.0 / links));
  });
  EXPECT_THAT(found.trials, SizeIs(1 + 10 + 10));
  EXPECT_EQ(found.options, chosen(0.25, 1.0));
}

TEST_F(RefineThresholds, StopsWhenInterrupted) {
  const World bad = [](double links, double) { return std::pair(9.0, int(100.0 / links)); };
  EXPECT_THAT(refine(0.5, bad, 1).trials, SizeIs(1));
  EXPECT_THAT(refine(0.5, bad, 4).trials, SizeIs(4));
  EXPECT_THAT(refine(0.5, bad, 15).trials, SizeIs(15));
}

TEST(ThresholdTrials, TheirErrorIsTheLargerEstimate) {
  EXPECT_EQ((ThresholdTrial{.expected = 2.0, .realised = 3.0}).error(), 3.0);
  EXPECT_EQ((ThresholdTrial{.expected = 4.0, .realised = 3.0}).error(), 4.0);
}

class FindThresholds : public ::testing::Test {
 protected:
  FoundThresholds find(const std::string& policy, double error_ratio) {
    return find_thresholds({parse_component(policy)}, 150, error_ratio, setting_);
  }
  static PolicyData world(Registry& registry) {
    Simulation made =
        registry.make<Generator>("manhattan:poses=200,streets=4")->generate(registry, 3);
    return policy_data(std::move(made.graph));
  }
  Registry registry_;
  PolicyData data_ = world(registry_);
  PolicySetting setting_{.data = data_, .registry = registry_};
};

TEST_F(FindThresholds, WhatIsFoundKeepsTheErrorWithinTheTolerance) {
  const FoundThresholds found = find("compact_pose", 2.5);
  ASSERT_FALSE(found.trials.empty());
  EXPECT_GT(found.expected_ate, 0.0);
  EXPECT_GE(found.tolerance, 2.5 * found.expected_ate);
  EXPECT_LE(found.trials[found.chosen].error(), found.tolerance);
  EXPECT_GE(found.trials[found.chosen].realised, found.expected_ate);

  // A run with these options is what the last trial was.
  PolicyJob job{{"compact_pose", found.options}};
  PolicyRun run(job, setting_);
  run.run(150, "");
  EXPECT_EQ(run.policy().estimator().variable_count(), found.trials[found.chosen].poses_kept);
  EXPECT_EQ(run.counts().kept_loops, found.trials[found.chosen].loops_kept);
}

TEST_F(FindThresholds, ASampleIsExtendedUntilItHasLoopClosures) {
  const ThresholdSample sample = threshold_sample(data_, 0.01);
  EXPECT_EQ(sample.asked, 2U);
  ASSERT_GT(sample.count, sample.asked);
  std::ptrdiff_t loops = 0;
  for (std::size_t k = 0; k + 1 < sample.count; ++k) loops += std::ssize(data_.poses[k].links);
  EXPECT_LT(loops, 3);
  EXPECT_GE(loops + std::ssize(data_.poses[sample.count - 1].links), 3);
  EXPECT_EQ(threshold_sample(data_, 0.6).count, 120U);
}

TEST_F(FindThresholds, AreFoundWhereTheyAreNotGivenAndThePolicyCan) {
  EXPECT_FALSE(gives_thresholds(parse_component("compact_pose:gate=0.9,strategy=apfl")));
  for (const char* given : {"range=3", "loop_gain=2", "pose_gain=1"})
    EXPECT_TRUE(gives_thresholds(parse_component(std::string("compact_pose:") + given))) << given;
  EXPECT_TRUE(finds_thresholds(parse_component("compact_pose:range=3"), registry_));
  EXPECT_FALSE(finds_thresholds(parse_component("random_poses"), registry_));
}

TEST_F(FindThresholds, TriesNothingAtRatioZero) {
  const FoundThresholds found = find("compact_pose", 0.0);
  EXPECT_THAT(found.trials, IsEmpty());
  EXPECT_TRUE(found.options.contains("range"));
  EXPECT_TRUE(found.options.contains("loop_gain"));
}

TEST_F(FindThresholds, ASmallerErrorIsAllowedFewerOmissions) {
  const FoundThresholds loose = find("compact_pose", 10.0), tight = find("compact_pose", 1.05);
  EXPECT_GE(tight.trials.back().loops_kept, loose.trials.back().loops_kept);
  EXPECT_GE(tight.trials.size(), loose.trials.size());
}

/// Information that is a hundred times too small, as in many files: the error that is allowed is
/// that of the residuals, not of the file's covariances.
TEST_F(FindThresholds, TheToleranceDoesNotDependOnTheScaleOfTheInformation) {
  const FoundThresholds right = find("compact_pose", 2.5);
  EXPECT_GT(right.noise_scale, 0.5);
  Graph& graph = data_.recording;
  for (int f = 0; f < graph.factor_count(); ++f) {
    Factor factor = graph.factor(f);
    for (double& entry : factor.information) entry *= 0.01;
    graph.set_measurement(f, factor.measurement, factor.information);
  }
  const FoundThresholds coarse = find("compact_pose", 2.5);
  EXPECT_NEAR(coarse.noise_scale, 0.1 * right.noise_scale, 0.02);
  EXPECT_NEAR(coarse.tolerance, right.tolerance, 0.2 * right.tolerance);
  // Nearly the same ones: the distance test goes by deviations as they are in both.
  EXPECT_NEAR(coarse.trials.back().poses_kept, right.trials.back().poses_kept, 10);
}

TEST_F(FindThresholds, APolicyThatFindsNothingIsRefused) {
  EXPECT_THROW(find("random_poses", 2.5), Error);
}

}  // namespace
}  // namespace cairn
