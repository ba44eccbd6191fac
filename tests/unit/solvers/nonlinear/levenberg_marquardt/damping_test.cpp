// SPDX-License-Identifier: BSD-3-Clause
#include "levenberg_marquardt/damping.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace cairn {
namespace {

constexpr double kSmallest = 1e-20, kLargest = 1e16;

TEST(Damping, FollowsNielsensRuleBetweenStepsThatGainSomethingElse) {
  Damping damping(1.0, kSmallest, kLargest, true);
  damping.ease(0.5);  // 1 − 0³
  EXPECT_DOUBLE_EQ(damping.lambda(), 1.0);
  damping.ease(0.75);  // 1 − ½³
  EXPECT_DOUBLE_EQ(damping.lambda(), 0.875);
  damping.ease(0.0);  // 1 + 1
  EXPECT_DOUBLE_EQ(damping.lambda(), 1.75);
  damping.ease(2.0);  // not below a third
  EXPECT_DOUBLE_EQ(damping.lambda(), 1.75 / 3.0);
}

TEST(Damping, GrowsFasterWithEachFailureInARow) {
  Damping damping(1e-3, kSmallest, kLargest, true);
  for (const double expected : {2e-3, 8e-3, 64e-3}) {
    damping.raise();
    EXPECT_DOUBLE_EQ(damping.lambda(), expected);
  }
  damping.ease(0.5);
  damping.raise();
  EXPECT_DOUBLE_EQ(damping.lambda(), 128e-3);
}

TEST(Damping, FallsFasterWithEachStepInARowThatGainsWhatWasPredicted) {
  Damping damping(1.0, kSmallest, kLargest, true);
  for (const double expected : {1.0 / 3.0, 1.0 / 27.0, 1.0 / 2187.0}) {
    damping.ease(1.0);
    EXPECT_NEAR(damping.lambda(), expected, 1e-15);
  }
  // Any other step, and any failure, makes it begin again.
  damping.ease(0.5);
  damping.ease(1.0);
  EXPECT_NEAR(damping.lambda(), 1.0 / 6561.0, 1e-15);
  damping.raise();
  damping.ease(1.0);
  EXPECT_NEAR(damping.lambda(), 2.0 / 19683.0, 1e-15);
}

TEST(Damping, FallsByAMillionAtMostAndNotBelowItsLimit) {
  Damping damping(1.0, kSmallest, kLargest, true);
  double before = 1.0;
  for (int k = 0; k < 100; ++k) {
    damping.ease(1.0);
    EXPECT_GE(damping.lambda(), std::max(kSmallest, 0.999e-6 * before));
    before = damping.lambda();
  }
  EXPECT_EQ(before, kSmallest);
}

TEST(Damping, TheFirstFailureEndsAnOptimisticStart) {
  Damping damping(1e-10, kSmallest, kLargest, true);
  damping.ease(0.9);
  damping.raise();
  EXPECT_EQ(damping.lambda(), 1e-6);
  damping.raise();
  EXPECT_DOUBLE_EQ(damping.lambda(), 2e-6);
  // Later failures are at a λ that steps have led to.
  while (damping.lambda() > 1e-12) damping.ease(1.0);
  const double little = damping.lambda();
  damping.raise();
  EXPECT_DOUBLE_EQ(damping.lambda(), 2.0 * little);
}

TEST(Damping, TheFirstFailureOfAHeavyDampingRaisesIt) {
  Damping damping(1e-3, kSmallest, kLargest, true);
  damping.raise();
  EXPECT_DOUBLE_EQ(damping.lambda(), 2e-3);
}

TEST(Damping, FollowsNielsensRuleAloneWhereHNeedsDamping) {
  Damping damping(1e-10, kSmallest, kLargest, false);
  damping.raise();
  EXPECT_DOUBLE_EQ(damping.lambda(), 2e-10);
  damping.ease(1.0);
  damping.ease(1.0);
  EXPECT_DOUBLE_EQ(damping.lambda(), 2e-10 / 9.0);
}

TEST(Damping, EndsAtItsLargest) {
  Damping damping(1e-10, kSmallest, 1e-7, true);
  EXPECT_FALSE(damping.at_limit());
  damping.raise();
  EXPECT_TRUE(damping.at_limit());
  EXPECT_EQ(damping.lambda(), 1e-7);
}

}  // namespace
}  // namespace cairn
