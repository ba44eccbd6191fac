// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

using IdPairs = std::vector<std::pair<Id, Id>>;

/// Ids are 0, 1, 2 …
Trajectory at(const std::vector<double>& stamps) {
  Trajectory poses;
  for (const double stamp : stamps) {
    TrajectoryPose pose;
    pose.id = static_cast<Id>(poses.size());
    pose.stamp = stamp;
    poses.push_back(pose);
  }
  return poses;
}

Trajectory with_ids(const std::vector<Id>& ids) {
  Trajectory poses;
  for (const Id id : ids) {
    poses.emplace_back();
    poses.back().id = id;
  }
  return poses;
}

IdPairs ids(const TrajectoryPairs& pairs) {
  IdPairs result;
  for (std::size_t k = 0; k < pairs.truth.size(); ++k) {
    result.emplace_back(pairs.estimate[k].id, pairs.truth[k].id);
  }
  return result;
}

IdPairs by_stamp(const std::vector<double>& estimate, const std::vector<double>& truth,
                 const StampMatching& matching) {
  return ids(pair_by_stamp(at(estimate), at(truth), matching));
}

std::string refusal(const Trajectory& estimate, const Trajectory& truth,
                    const StampMatching& matching) {
  try {
    pair_by_stamp(estimate, truth, matching);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

TEST(PairById, TakesWhatIsInBothAndCountsTheRest) {
  const TrajectoryPairs pairs = pair_by_id(with_ids({1, 2, 5, 9}), with_ids({0, 2, 3, 4, 9}));
  EXPECT_THAT(ids(pairs), ElementsAre(Pair(2, 2), Pair(9, 9)));
  EXPECT_EQ(pairs.only_in_estimate, 2);
  EXPECT_EQ(pairs.only_in_truth, 3);
  EXPECT_THROW(pair_by_id(with_ids({1, 2}), with_ids({2, 3})), Error);
}

TEST(PairByStamp, FindsTheNearestAtOtherRates) {
  const TrajectoryPairs pairs =
      pair_by_stamp(at({0.5, 1.5, 2.5}), at({0.0, 0.25, 0.491, 0.75, 1.0, 1.25, 1.508, 1.75, 2.3}),
                    {.max_difference = 0.01});
  EXPECT_THAT(ids(pairs), ElementsAre(Pair(0, 2), Pair(1, 6)));
  EXPECT_EQ(pairs.only_in_estimate, 1);
  EXPECT_EQ(pairs.only_in_truth, 7);
  EXPECT_NEAR(pairs.largest_difference, 0.009, 1e-15);
}

TEST(PairByStamp, ShiftsTheEstimate) {
  EXPECT_THAT(by_stamp({0, 1, 2}, {101.5, 102.5, 103.5}, {.offset = 101.5}),
              ElementsAre(Pair(0, 0), Pair(1, 1), Pair(2, 2)));
  EXPECT_THAT(by_stamp({101.5, 102.5}, {-1, 0, 1}, {.offset = -102.5}),
              ElementsAre(Pair(0, 0), Pair(1, 1)));
}

// 1.0 is near to both 1.1 and 1.2, and goes to the nearer; the other is left over.
TEST(PairByStamp, GivesEachPoseOnePartnerTheNearestFirst) {
  EXPECT_THAT(by_stamp({0.0, 1.1, 1.2, 3.0}, {0.2, 1.0, 3.1}, {.max_difference = 0.5}),
              ElementsAre(Pair(0, 0), Pair(1, 1), Pair(3, 2)));
}

// The nearest of what is left are 0 and 20, which are on either side of the first pair.
TEST(PairByStamp, KeepsTheOrderOfTime) {
  EXPECT_THAT(by_stamp({0, 10.5, 30}, {10, 20, 30.5}, {.max_difference = 100}),
              ElementsAre(Pair(1, 0), Pair(2, 2)));
}

TEST(PairByStamp, TakesTheEarlierOfEquallyNear) {
  EXPECT_THAT(by_stamp({1, 3}, {0, 2, 4}, {.max_difference = 1}),
              ElementsAre(Pair(0, 0), Pair(1, 1)));
}

TEST(PairByStamp, MatchesEqualStampsWhateverIsAllowed) {
  EXPECT_THAT(by_stamp({0, 1, 2, 3}, {1, 3}, {.max_difference = 0}),
              ElementsAre(Pair(1, 0), Pair(3, 1)));
}

/// All pairs by rising difference, each taken if both are free and it crosses none taken before.
IdPairs slow_pairs(const std::vector<double>& estimate, const std::vector<double>& truth,
                   double max_difference) {
  std::vector<std::tuple<double, int, int>> all;
  for (int e = 0; e < static_cast<int>(estimate.size()); ++e) {
    for (int t = 0; t < static_cast<int>(truth.size()); ++t) {
      const double difference = std::abs(estimate[e] - truth[t]);
      if (difference <= max_difference) all.emplace_back(difference, e, t);
    }
  }
  std::sort(all.begin(), all.end());
  IdPairs taken;
  for (const auto& [difference, e, t] : all) {
    const auto clashes = [e = e, t = t](const std::pair<Id, Id>& other) {
      return other.first == e || other.second == t || (other.first < e) != (other.second < t);
    };
    if (std::none_of(taken.begin(), taken.end(), clashes)) taken.emplace_back(e, t);
  }
  std::sort(taken.begin(), taken.end());
  return taken;
}

TEST(PairByStamp, AgreesWithTheRuleAppliedToAllPairs) {
  std::mt19937 engine(1);
  const auto draw = [&](int count) {
    std::vector<double> stamps(static_cast<std::size_t>(count));
    for (double& stamp : stamps) stamp = std::uniform_real_distribution<>(0.0, 10.0)(engine);
    std::sort(stamps.begin(), stamps.end());
    return stamps;
  };
  for (int trial = 0; trial < 300; ++trial) {
    const std::vector<double> estimate = draw(5 + trial % 40), truth = draw(5 + trial % 7 * 10);
    const double max_difference = 0.03 * std::pow(2.0, trial % 10);
    const IdPairs expected = slow_pairs(estimate, truth, max_difference);
    if (expected.size() < 2) continue;
    EXPECT_EQ(by_stamp(estimate, truth, {.max_difference = max_difference}), expected);
    // Which of the two is called the estimate makes no difference.
    IdPairs swapped = by_stamp(truth, estimate, {.max_difference = max_difference});
    for (auto& [a, b] : swapped) std::swap(a, b);
    EXPECT_EQ(swapped, expected);
  }
}

TEST(PairByStamp, SaysWhatWouldHelpWhereTooLittleMatches) {
  EXPECT_THAT(
      refusal(at({0.5, 9.5}), at({1000.25, 1010.5}), {}),
      AllOf(HasSubstr("of 2 estimated and 2 true poses only 0 match within 0.01 s"),
            HasSubstr("estimate go from 0.5 to 9.5 s"), HasSubstr("truth from 1000.25 to 1010.5 s"),
            HasSubstr("StampMatching::offset 999.75 ")));
  // The offset that was given already is part of what is advised.
  EXPECT_THAT(refusal(at({0.5, 9.5}), at({1000.25, 1010.5}), {.offset = 100}),
              AllOf(HasSubstr("shifted by 100 s, go from 100.5 to 109.5 s"),
                    HasSubstr("StampMatching::offset 999.75 ")));
  EXPECT_THAT(refusal(at({0.5, 1.5, 2.5}), at({0.25, 1.25, 2.5}), {}),
              AllOf(HasSubstr("only 1 match"), HasSubstr("StampMatching::max_difference")));
  EXPECT_THAT(refusal(at({0.5, 1.5}), at({1, 2}), {}), HasSubstr("nearest two are 0.5 s apart"));
  EXPECT_THAT(refusal(at({}), at({1, 2}), {}),
              AllOf(HasSubstr("of 0 estimated"), Not(HasSubstr("StampMatching::offset"))));
}

TEST(PairByStamp, NamesAnotherUnitInsteadOfAnOffsetThatCannotHelp) {
  const auto times = [](double begin, double step) {
    std::vector<double> all;
    for (int k = 0; k < 20; ++k) all.push_back(begin + k * step);
    return at(all);
  };
  EXPECT_THAT(refusal(times(5e9, 1e8), times(1000, 0.1), {}),
              AllOf(HasSubstr("the estimate lasts about 1e+09 times as long as the truth: its "
                              "stamps may be nanoseconds"),
                    Not(HasSubstr("offset"))));
  EXPECT_THAT(refusal(times(1000, 0.1), times(5e6, 100), {}),
              AllOf(HasSubstr("the truth lasts about 1e+03 times"), HasSubstr("milliseconds"),
                    Not(HasSubstr("offset"))));
  EXPECT_THAT(refusal(times(0, 0.1), times(1e4, 5.0), {}),
              AllOf(HasSubstr("no offset lets both begin together and go on so"),
                    Not(HasSubstr("StampMatching::offset"))));
}

TEST(PairById, SaysWhereTimesOfOneWaitForThoseOfTheOther) {
  const auto message = [](const Trajectory& estimate, const Trajectory& truth) {
    try {
      pair_by_id(estimate, truth);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(with_ids({70, 71}), at({0.5, 1.5})),
              HasSubstr("the truth has time stamps: with those of the estimate as well"));
  EXPECT_THAT(message(with_ids({70, 71}), with_ids({0, 1})), Not(HasSubstr("time stamps")));
}

TEST(RowPairing, IsUnfoundedWhereTimesOfOneSayThatRowsAreNoIds) {
  const Trajectory ids = with_ids({0, 1, 2}), timed = at({0.5, 0.75, 1.0, 1.25});
  EXPECT_EQ(row_pairing(pair_by_id(ids, timed), false, true), RowPairing::unfounded);
  EXPECT_EQ(row_pairing(pair_by_id(timed, ids), true, false), RowPairing::unfounded);
  EXPECT_EQ(row_pairing(pair_by_id(ids, with_ids({0, 1, 2, 3})), false, true), RowPairing::partial);
  EXPECT_EQ(row_pairing(pair_by_id(ids, at({0.5, 0.75, 1.0})), false, true), RowPairing::complete);
  EXPECT_EQ(row_pairing(pair_by_id(ids, with_ids({1, 2, 9})), false, false), RowPairing::none);
}

TEST(StampsTellMore, WhereBothHaveThemAndTheyAreNotTheIds) {
  const Trajectory ids_as_stamps = at({0, 1, 2}), times = at({0, 0.5, 1}), none = with_ids({0, 1});
  EXPECT_TRUE(stamps_tell_more(times, times));
  EXPECT_TRUE(stamps_tell_more(ids_as_stamps, times));
  EXPECT_TRUE(stamps_tell_more(times, ids_as_stamps));
  EXPECT_FALSE(stamps_tell_more(ids_as_stamps, ids_as_stamps));
  EXPECT_FALSE(stamps_tell_more(times, none));
  EXPECT_FALSE(stamps_tell_more(none, times));
}

}  // namespace
}  // namespace cairn
