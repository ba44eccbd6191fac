// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/threads.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

class Threads : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    before_ = threads();
    set_threads(GetParam());
  }
  void TearDown() override { set_threads(before_); }
  int before_ = 0;
};

TEST_P(Threads, EveryChunkRunsOnce) {
  std::vector<int> runs(1000, 0);
  for_each_chunk(runs.size(), [&](std::size_t chunk) { ++runs[chunk]; });
  EXPECT_EQ(runs, std::vector<int>(1000, 1));
  for_each_chunk(0, [](std::size_t) { FAIL(); });
}

TEST_P(Threads, RangesCoverTheWholeWithoutOverlap) {
  std::vector<int> runs(1037, 0);
  for_each_range(runs.size(), 64, [&](std::size_t begin, std::size_t end) {
    EXPECT_EQ(begin % 64, 0U);
    for (std::size_t k = begin; k < end; ++k) ++runs[k];
  });
  EXPECT_EQ(runs, std::vector<int>(1037, 1));
}

TEST_P(Threads, AnExceptionReachesTheCaller) {
  EXPECT_THROW(for_each_chunk(50,
                              [](std::size_t chunk) {
                                if (chunk == 31) throw std::runtime_error("x");
                              }),
               std::runtime_error);
}

TEST_P(Threads, WhatAChunkWroteIsSeenAfterTheLoop) {
  std::vector<double> values(4096, 0.0);
  double sum = 0.0;
  for (int round = 0; round < 20; ++round) {
    for_each_range(values.size(), 128, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) values[k] += 1.0;
    });
    for (const double v : values) sum += v;
  }
  EXPECT_EQ(sum, 4096.0 * 210.0);
}

TEST(ThreadCount, IsRefusedWhereNoMachineHasSoMany) {
  const int before = threads();
  for (const int count : {-1, kMostThreads + 1, 1000000000})
    EXPECT_THROW(set_threads(count), Error) << count;
  EXPECT_EQ(threads(), before);
}

INSTANTIATE_TEST_SUITE_P(OneTwoThree, Threads, ::testing::Values(1, 2, 3));

}  // namespace
}  // namespace cairn
