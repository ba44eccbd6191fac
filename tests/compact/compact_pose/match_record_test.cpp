// SPDX-License-Identifier: BSD-3-Clause
// With a limit of requests per pose, those come first that are likely to be answered.
#include "match_record.hpp"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "compact/compact_pose/robot.hpp"

namespace cairn::compact {
namespace {

TEST(MatchRecord, BeginsWithTheMeanOfAllPosesAndLearnsTheirOwn) {
  MatchRecord record;
  EXPECT_DOUBLE_EQ(record.probability(5), 0.5);
  for (int k = 0; k < 6; ++k) record.note(2, false);
  EXPECT_DOUBLE_EQ(record.probability(5), 1.0 / 8.0);
  EXPECT_DOUBLE_EQ(record.probability(2), 3.0 / 8.0 / 9.0);
  record.note(2, true);
  EXPECT_DOUBLE_EQ(record.probability(5), 2.0 / 9.0);
  EXPECT_DOUBLE_EQ(record.probability(2), (3.0 * 2.0 / 9.0 + 1.0) / 10.0);
}

/// Drives on a circle on which even poses never match; counts requests by that, and links.
struct Requests {
  int even = 0, odd = 0, most = 0, links = 0;
};
Requests drive(Registry& registry, const std::string& options) {
  Robot robot(registry, "strategy=apfl,range=6,angle=1.5,loop_gain=0.3" + options);
  Requests requests;
  for (int k = 0; k < 100; ++k) {
    robot.advance();
    int asked = 0;
    while (const auto match = robot.policy().next_match()) {
      ++asked;
      const bool matches = match->earlier % 2 == 1;
      ++(matches ? requests.odd : requests.even);
      if (matches) {
        requests.links += robot.offer(robot.right(match->earlier)).verdict == LinkVerdict::linked;
      } else {
        robot.policy().offer(match->earlier, {});
      }
    }
    requests.most = std::max(requests.most, asked);
  }
  return requests;
}

TEST_F(CompactPoseTest, AsksForNoMoreMatchesThanAllowedAndLearnsWhereTheySucceed) {
  const Requests free = drive(registry, ""), few = drive(registry, ",matches=2");
  EXPECT_GT(free.most, 4);
  EXPECT_EQ(few.most, 2);
  EXPECT_GT(free.even, free.odd / 2);
  EXPECT_LT(few.even, few.odd / 2);
  EXPECT_LT(few.even + few.odd, (free.even + free.odd) / 2);
  EXPECT_GT(few.links, 0.65 * (few.even + few.odd));
  EXPECT_LT(free.links, 0.55 * (free.even + free.odd));
}

TEST(MatchRecord, ARevokedMatchWasARequestInVain) {
  MatchRecord revoked, vain;
  for (const int pose : {0, 1, 1, 2}) {
    revoked.note(pose, true);
    vain.note(pose, pose != 2);
  }
  revoked.revoke(2);
  revoked.revoke(2);  // it never had another
  revoked.revoke(9);
  for (const int pose : {0, 1, 2, 3}) EXPECT_EQ(revoked.probability(pose), vain.probability(pose));
}

}  // namespace
}  // namespace cairn::compact
