// SPDX-License-Identifier: BSD-3-Clause
// Which poses are proposed where the newest is uncertain beside the sensor's range.
#include <cmath>
#include <set>

#include "robot.hpp"

namespace cairn::compact {
namespace {

constexpr int kLap = 63;  // of the circle of radius 10 m

struct Proposed {
  std::vector<int> of_pose;  ///< how many for each pose after the first lap
  std::set<std::pair<Id, Id>> pairs;
};

/// A lap without matches and 40 poses more; what is proposed for these, to each of which the answer
/// is that there is no match.
Proposed proposed(Registry& registry, const std::string& options) {
  Robot robot(registry, "probability=0.1,angle=1," + options);
  Proposed out;
  for (int k = 1; k < kLap; ++k) robot.advance();
  for (int k = 0; k < 40; ++k) {
    robot.advance();
    int count = 0;
    while (const auto match = robot.policy().next_match()) {
      out.pairs.insert({match->earlier, match->later});
      robot.policy().offer(match->earlier, {});
      ++count;
    }
    out.of_pose.push_back(count);
  }
  return out;
}

class WideSearch : public CompactPoseTest {};

// Each pose sees that of the lap before, 63 poses earlier, to 0.3 m. Their displacement has a
// deviation of more than 2 m.
TEST_F(WideSearch, ALoopClosureIsProposedHoweverUncertainItIs) {
  const Proposed wide = proposed(registry, "range=0.25"),
                 narrow = proposed(registry, "range=0.25,wide=false");
  int seen = 0;
  for (const auto& [earlier, later] : wide.pairs) seen += later - earlier == kLap;
  EXPECT_GE(seen, 10);
  for (const auto& [earlier, later] : narrow.pairs) EXPECT_LT(later - earlier, kLap / 2);
}

TEST_F(WideSearch, IsRepeatedOnlyAfterFiveRanges) {
  // 3.95 m, by steps of 1 m.
  const Proposed wide = proposed(registry, "range=0.79"),
                 narrow = proposed(registry, "range=0.79,wide=false");
  int searches = 0, last = -4;
  for (int k = 0; k < 40; ++k) {
    const int more = wide.of_pose[k] - narrow.of_pose[k];
    if (more == 0) continue;
    EXPECT_GE(k - last, 4);
    EXPECT_LE(more, 64);
    last = k, ++searches;
  }
  EXPECT_GE(searches, 8);
}

TEST_F(WideSearch, IsTheSameWithAndWithoutTheIndex) {
  const Proposed index = proposed(registry, "range=0.25"),
                 all = proposed(registry, "range=0.25,search=all");
  EXPECT_EQ(index.pairs, all.pairs);
  EXPECT_FALSE(index.pairs.empty());
}

}  // namespace
}  // namespace cairn::compact
