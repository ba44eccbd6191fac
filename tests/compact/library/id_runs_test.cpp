// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/id_runs.hpp"

#include <random>
#include <set>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(IdRuns, HaveWhatASetHas) {
  std::mt19937 random(3);
  for (int repeat = 0; repeat < 50; ++repeat) {
    IdRuns runs;
    std::set<Id> ids;
    for (int k = 0; k < 60; ++k) {
      const Id id = static_cast<Id>(random() % 80) - 40;
      runs.insert(id);
      ids.insert(id);
    }
    std::size_t begins = 0;
    for (Id id = -45; id < 45; ++id) {
      EXPECT_EQ(runs.contains(id), ids.contains(id)) << id;
      begins += ids.contains(id) && !ids.contains(id - 1);
    }
    EXPECT_EQ(runs.run_count(), begins);
  }
}

TEST(IdRuns, OfARobotThatCountsAreOne) {
  IdRuns runs;
  for (Id id = 0; id < 100000; ++id) runs.insert(id);
  EXPECT_EQ(runs.run_count(), 1U);
}

}  // namespace
}  // namespace cairn
