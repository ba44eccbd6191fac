// SPDX-License-Identifier: BSD-3-Clause
#include "pace.hpp"

#include <gtest/gtest.h>

namespace cairn::incremental {
namespace {

/// A clock that a test moves, and counts how often it is read.
struct HandMovedClock {
  double time = 0.0;
  int reads = 0;
  void drive(Pace& pace) {
    pace.set_clock([this] {
      ++reads;
      return time;
    });
  }
};

TEST(Pace, AllowsEverythingWithoutALimitAndReadsNoClock) {
  Pace pace;
  HandMovedClock clock;
  clock.drive(pace);
  pace.begin(0.0);
  for (int k = 0; k < 100; ++k) EXPECT_TRUE(pace.allows(Work::evaluate, 1e12));
  EXPECT_EQ(clock.reads, 0);
}

TEST(Pace, AllowsTheFirstPieceOfAnUpdateWhateverItTakes) {
  Pace pace;
  HandMovedClock clock;
  clock.drive(pace);
  for (int update = 0; update < 3; ++update) {
    pace.begin(1.0);
    EXPECT_TRUE(pace.allows(Work::factorize, 1e15));
    clock.time += 7.0;
    EXPECT_FALSE(pace.allows(Work::factorize, 1.0)) << "the time is up";
  }
}

TEST(Pace, LearnsWhatWorkTakesAndAllowsWhatFits) {
  Pace pace;
  HandMovedClock clock;
  clock.drive(pace);
  for (int update = 0; update < 300; ++update) {  // ten units a second
    pace.begin(100.0);
    ASSERT_TRUE(pace.allows(Work::evaluate, 10.0));
    clock.time += 1.0;
    ASSERT_TRUE(pace.allows(Work::move, 0.0));
  }
  pace.begin(100.0);
  ASSERT_TRUE(pace.allows(Work::evaluate, 10.0));
  clock.time += 1.0;
  EXPECT_TRUE(pace.allows(Work::evaluate, 980.0));
  EXPECT_FALSE(pace.allows(Work::evaluate, 1000.0));
}

TEST(Pace, OnePieceThatWasInterruptedCountsForLittle) {
  Pace pace;
  HandMovedClock clock;
  clock.drive(pace);
  for (int update = 0; update < 300; ++update) {
    pace.begin(100.0);
    ASSERT_TRUE(pace.allows(Work::evaluate, 10.0));
    clock.time += update == 299 ? 1e6 : 1.0;
    pace.allows(Work::move, 0.0);
  }
  pace.begin(100.0);
  ASSERT_TRUE(pace.allows(Work::order, 1.0));
  EXPECT_TRUE(pace.allows(Work::evaluate, 800.0));
}

TEST(Pace, KeepsTimeFreeForWhatComesLast) {
  Pace pace;
  HandMovedClock clock;
  clock.drive(pace);
  pace.begin(10.0);
  ASSERT_TRUE(pace.allows(Work::move, 1.0));
  clock.time = 9.0;
  EXPECT_TRUE(pace.allows(Work::move, 1.0));
  pace.keep_free(2.0);
  EXPECT_FALSE(pace.allows(Work::move, 1.0));
  pace.keep_free(0.0);
  EXPECT_TRUE(pace.allows(Work::move, 1.0));
}

}  // namespace
}  // namespace cairn::incremental
