// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/mean_interval.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// From printed tables of the distribution (Fisher and Yates).
TEST(StudentT, QuantilesAreThoseOfTheTables) {
  EXPECT_NEAR(student_t_quantile(0.975, 1), 12.706, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 4), 2.776, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 49), 2.010, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.95, 10), 1.812, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.5, 3), 0.0, 1e-12);
}

/// Student's own data (1908): hours of sleep gained with two drugs, by the same ten patients. The
/// test of the differences has t = 4.062, and their interval is (0.70, 2.46).
TEST(MeanInterval, OfStudentsSleepIsAsPublished) {
  const std::vector<double> first{0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0};
  const std::vector<double> second{1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4};
  const MeanInterval difference = paired_difference(second, first);
  EXPECT_EQ(difference.count, 10);
  EXPECT_NEAR(difference.mean, 1.58, 1e-12);
  EXPECT_NEAR(difference.mean / (difference.deviation / std::sqrt(10.0)), 4.0621, 5e-5);
  EXPECT_NEAR(difference.low(), 0.7001142, 1e-6);
  EXPECT_NEAR(difference.high(), 2.4598858, 1e-6);
  EXPECT_TRUE(difference.excludes_zero());
  // Without pairing the same data do not suffice (Welch: −0.205 to 3.365; here each mean alone).
  EXPECT_FALSE(mean_interval(first).excludes_zero());
  EXPECT_NEAR(mean_interval(first).mean, 0.75, 1e-12);
}

TEST(MeanInterval, LeavesOutWhatIsNotFiniteAndSaysWhatItCannot) {
  const MeanInterval two = mean_interval(std::vector{1.0, kNone, 3.0});
  EXPECT_EQ(two.count, 2);
  EXPECT_DOUBLE_EQ(two.mean, 2.0);
  EXPECT_DOUBLE_EQ(two.deviation, std::sqrt(2.0));
  EXPECT_NEAR(two.half_width, 12.7062, 1e-4);
  const MeanInterval one = mean_interval(std::vector{1.0});
  EXPECT_DOUBLE_EQ(one.mean, 1.0);
  EXPECT_TRUE(std::isnan(one.half_width));
  EXPECT_FALSE(one.excludes_zero());
  EXPECT_TRUE(std::isnan(mean_interval({}).mean));
  EXPECT_EQ(paired_difference(std::vector{1.0, kNone, 5.0}, std::vector{kNone, 2.0, 2.0}).count, 1);
}

TEST(MeanInterval, HoldsTheTrueMeanAsOftenAsItSays) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(3.0, 2.0);
  constexpr int kSamples = 4000;
  int held = 0;
  for (int k = 0; k < kSamples; ++k) {
    std::vector<double> values(5);
    for (double& value : values) value = noise(random);
    const MeanInterval interval = mean_interval(values, 0.9);
    held += interval.low() <= 3.0 && 3.0 <= interval.high();
  }
  // Three standard deviations of a binomial variable: 0.0142.
  EXPECT_NEAR(static_cast<double>(held) / kSamples, 0.9, 0.0143);
}

TEST(IntervalText, HasTheDigitsThatTheIntervalIsWorth) {
  EXPECT_EQ(interval_text({.count = 5, .mean = 741.32, .half_width = 12.4}), "741 ± 12");
  EXPECT_EQ(interval_text({.count = 5, .mean = 0.04312, .half_width = 0.0081}), "0.0431 ± 0.0081");
  EXPECT_EQ(interval_text({.count = 5, .mean = 0.53, .half_width = 1.23}, true), "+0.5 ± 1.2");
  EXPECT_EQ(interval_text({.count = 1, .mean = 12.0, .half_width = kNone}), "12.00");
  EXPECT_EQ(interval_text({.count = 3, .mean = 2.0, .half_width = 0.0}), "2.000 ± 0.000");
  EXPECT_EQ(interval_text(mean_interval({})), "-");
}

TEST(RunCurve, IsInterpolatedWhereItRises) {
  const RunCurve curve{.x = {1.0, 3.0, 2.0, 3.0, 5.0}, .y = {10.0, 20.0, 99.0, 30.0, 50.0}};
  const std::vector<double> places{0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  const std::vector<double> kept = values_at(curve, places, BeyondEnd::keep);
  EXPECT_TRUE(std::isnan(kept[0]));
  EXPECT_EQ(std::vector(kept.begin() + 1, kept.end()),
            (std::vector{10.0, 20.0, 30.0, 40.0, 50.0, 50.0}));
  const std::vector<double> unknown = values_at(curve, places, BeyondEnd::unknown);
  EXPECT_EQ(unknown[5], 50.0);
  EXPECT_TRUE(std::isnan(unknown[6]));
  EXPECT_TRUE(std::isnan(values_at({}, places, BeyondEnd::keep)[1]));
}

TEST(MeanCurve, IsTheMeanOfTheRunsThatAreThere) {
  const std::vector<RunCurve> runs{{.x = {0.0, 2.0}, .y = {0.0, 2.0}},
                                   {.x = {0.0, 4.0}, .y = {2.0, 6.0}}};
  const std::vector<double> places{1.0, 3.0};
  const auto kept = mean_curve(runs, places, BeyondEnd::keep);
  EXPECT_DOUBLE_EQ(kept[0].mean, 2.0);
  EXPECT_DOUBLE_EQ(kept[1].mean, 3.5);
  const auto unknown = mean_curve(runs, places, BeyondEnd::unknown);
  EXPECT_EQ(unknown[1].count, 1);
  EXPECT_DOUBLE_EQ(unknown[1].mean, 5.0);
}

}  // namespace
}  // namespace cairn
