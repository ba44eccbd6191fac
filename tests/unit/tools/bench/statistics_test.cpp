// SPDX-License-Identifier: BSD-3-Clause
#include "statistics.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace cairn::performance {
namespace {

TEST(Statistics, TakesTheMiddleOrTheMeanOfTheTwoInIt) {
  EXPECT_EQ(median({5.0, 1.0, 3.0}), 3.0);
  EXPECT_EQ(median({4.0, 1.0, 3.0, 100.0}), 3.5);
  EXPECT_TRUE(std::isnan(median({})));
}

TEST(Statistics, TakesTheLeastValueThatAPartDoesNotExceed) {
  EXPECT_EQ(percentile({4.0, 1.0, 3.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(percentile({4.0, 1.0, 3.0, 2.0}, 0.51), 3.0);
  EXPECT_EQ(percentile({4.0, 1.0, 3.0, 2.0}, 0.99), 4.0);
  EXPECT_EQ(percentile({4.0, 1.0}, 0.0), 1.0);
  EXPECT_TRUE(std::isnan(percentile({}, 0.5)));
}

TEST(Statistics, AveragesRatiosSoThatTwiceAndHalfAreOne) {
  EXPECT_DOUBLE_EQ(geometric_mean(std::array{2.0, 0.5}), 1.0);
  EXPECT_NEAR(geometric_mean(std::array{2.0, 4.0, 8.0}), 4.0, 1e-12);
  EXPECT_TRUE(std::isnan(geometric_mean({})));
}

TEST(Statistics, FindsTheExponentOfAPowerLaw) {
  const std::array x{1e4, 1e5, 3e5, 1e6};
  std::array<double, 4> y{};
  for (std::size_t k = 0; k < x.size(); ++k) y[k] = 3e-7 * std::pow(x[k], 1.25);
  EXPECT_NEAR(fitted_exponent(x, y), 1.25, 1e-12);
}

TEST(Statistics, FitsNothingThroughOnePoint) {
  EXPECT_TRUE(std::isnan(fitted_exponent(std::array{1.0}, std::array{1.0})));
}

}  // namespace
}  // namespace cairn::performance
