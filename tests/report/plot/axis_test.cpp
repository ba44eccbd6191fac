// SPDX-License-Identifier: BSD-3-Clause
#include "axis.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace cairn::plot {
namespace {

using ::testing::DoubleNear;
using ::testing::Ge;
using ::testing::Pointwise;
using ::testing::SizeIs;

TEST(Axis, ALogarithmicOneHasTicksBelowItsFirstPowerOfTen) {
  // Seconds of solvers, of which the fastest take less than one.
  const Range range{.low = 0.12, .high = 6.0, .logarithmic = true};
  EXPECT_THAT(range.ticks(6), Pointwise(DoubleNear(1e-9), {0.2, 0.5, 1.0, 2.0, 5.0}));
}

TEST(Axis, TicksLieWithinTheRange) {
  for (const double low : {1e-7, 0.003, 0.12, 0.99, 1.0, 7.0}) {
    for (const double factor : {1.2, 8.0, 20.0, 3e4, 1e9}) {
      const Range range{.low = low, .high = factor * low, .logarithmic = true};
      const std::vector<double> ticks = range.ticks(5);
      EXPECT_THAT(ticks, SizeIs(Ge(2))) << low << " times " << factor;
      for (const double tick : ticks) {
        EXPECT_GE(tick, range.low * (1 - 1e-9));
        EXPECT_LE(tick, range.high * (1 + 1e-9));
      }
    }
  }
}

TEST(Axis, OfIterationsHasWholeNumbersOnly) {
  Range range = range_of({0, 1, 2}, false);
  range.whole = true;
  const std::vector<double> ticks = range.ticks(6);
  EXPECT_THAT(ticks, Pointwise(DoubleNear(1e-12), {0.0, 1.0, 2.0}));
}

TEST(Axis, TicksOfOneAxisReadApart) {
  for (const double high : {3e-4, 2e-3, 0.7, 40.0, 2e6}) {
    const std::vector<double> ticks = range_of({0.0, high}, false).ticks(6);
    for (std::size_t k = 1; k < ticks.size(); ++k)
      EXPECT_NE(tick_text(ticks[k - 1]), tick_text(ticks[k])) << high;
  }
}

}  // namespace
}  // namespace cairn::plot
