// SPDX-License-Identifier: BSD-3-Clause
#include "random_poses.hpp"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using test::all_ids;
using test::PolicyRun;
using test::run;
using test::simulate;
using testing::Contains;
using testing::SizeIs;
using Pair = std::pair<Id, Id>;

class RandomPosesTest : public testing::Test {
 protected:
  PolicyRun keep(int poses, int loops, int seed = 1, const std::string& more = {}) {
    return run(registry, world,
               "random_poses:poses=" + std::to_string(poses) + ",loops=" + std::to_string(loops) +
                   ",seed=" + std::to_string(seed) + more,
               "recorded");
  }
  PolicyRun keep_poses_first(int poses, int loops, int seed = 1) {
    return keep(poses, loops, seed, ",draw=poses");
  }
  /// That the recording has, each once.
  std::set<Pair> loops() const {
    std::set<Pair> pairs;
    for (int f = 0; f < world.graph.factor_count(); ++f) {
      const auto v = world.graph.factor_variables(f);
      const auto [a, b] = std::minmax({world.graph.id(v[0]), world.graph.id(v[1])});
      if (b > a + 1) pairs.emplace(a, b);
    }
    return pairs;
  }
  static std::set<Id> kept(const PolicyRun& run) {
    const std::vector<Id> ids = run.kept();
    return {ids.begin(), ids.end()};
  }

  Registry registry;
  Simulation world = simulate(registry, "manhattan:poses=200,streets=5");
};

TEST_F(RandomPosesTest, KeepsSoManyPosesAndLoopsTheFirstAndTheLastPoseAmongThem) {
  for (const int poses : {2, 30, 100, 199, 200}) {
    const int most = poses < 30 ? 0 : 12;
    const PolicyRun few = keep(poses, most);
    EXPECT_THAT(few.kept(), SizeIs(poses));
    EXPECT_THAT(few.links(), SizeIs(most));
    EXPECT_THAT(few.kept(), Contains(0));
    EXPECT_THAT(few.kept(), Contains(199));
    EXPECT_EQ(few.policy->estimator().variable_count(), poses);
    EXPECT_EQ(few.policy->estimator().factor_count(), poses - 1 + most);
    EXPECT_EQ(few.policy->chains().size(), static_cast<std::size_t>(poses - 1));
    const std::set<Pair> all = loops();
    for (const Pair& link : few.links()) EXPECT_TRUE(all.contains(link));
  }
}

TEST_F(RandomPosesTest, UsesAllLoopsThereAreIfThatIsNotEnough) {
  const PolicyRun few = keep(60, 100'000);
  const std::set<Id> there = kept(few);
  EXPECT_THAT(there, SizeIs(60));
  std::set<Pair> expected;
  for (const auto& [a, b] : loops()) {
    if (there.contains(a) && there.contains(b)) expected.emplace(a, b);
  }
  const auto links = few.links();
  EXPECT_EQ(std::set<Pair>(links.begin(), links.end()), expected);
  EXPECT_EQ(links.size(), expected.size());
  EXPECT_GT(links.size(), 20U);
  EXPECT_EQ(keep(200, 100'000).links().size(), loops().size());
}

TEST_F(RandomPosesTest, DrawsTheSameForASeedAndOthersForAnother) {
  const PolicyRun one = keep(50, 10), same = keep(50, 10), other = keep(50, 10, 2);
  EXPECT_EQ(one.kept(), same.kept());
  EXPECT_EQ(one.links(), same.links());
  EXPECT_NE(one.kept(), other.kept());
  EXPECT_NE(one.links(), other.links());
}

// Each loop is as likely as any other.
TEST_F(RandomPosesTest, DrawsLoopsEvenly) {
  const std::set<Pair> all = loops();
  std::map<Pair, int> drawn;
  constexpr int kSeeds = 150, kLoops = 10;
  for (int seed = 0; seed < kSeeds; ++seed) {
    RandomPoses policy(registry.make<Estimator>("incremental_cholesky"),
                       {.poses = 40, .loops = kLoops, .seed = static_cast<std::uint64_t>(seed)});
    policy.expect(world.graph, pose_chain(world.graph));
    const auto registration = registry.make<Registration>("recorded");
    registration->begin({.recording = &world.graph});
    for (const Arrival& pose : pose_chain(world.graph)) {
      std::vector<Factor> odometry;
      for (const int f : pose.odometry) odometry.push_back(world.graph.factor(f));
      policy.add_pose(world.graph.variable(pose.pose()), odometry);
      std::vector<Id> matched;
      while (const auto match = policy.next_match()) {
        ++drawn[{match->earlier, match->later}];
        policy.offer(match->earlier, {});  // only the draw is of interest
      }
      policy.end_pose();
    }
  }
  const double expected = static_cast<double>(kSeeds * kLoops) / static_cast<double>(all.size());
  double chi2 = 0.0;
  for (const Pair& pair : all) chi2 += std::pow(drawn[pair] - expected, 2) / expected;
  const auto dof = static_cast<double>(all.size());
  EXPECT_LT(chi2, dof + 5.0 * std::sqrt(2.0 * dof));
  EXPECT_EQ(drawn.size(), all.size());
}

TEST_F(RandomPosesTest, PosesFirstKeepsSoManyPosesAndOnlyLoopsBetweenThem) {
  const std::set<Pair> all = loops();
  for (const int poses : {2, 100, 150, 200}) {
    const PolicyRun few = keep_poses_first(poses, 12);
    const std::set<Id> there = kept(few);
    EXPECT_THAT(there, SizeIs(poses));
    EXPECT_THAT(there, testing::IsSupersetOf({0, 199}));
    EXPECT_THAT(few.links(), SizeIs(poses == 2 ? 0 : 12));
    for (const Pair& link : few.links()) {
      EXPECT_TRUE(all.contains(link));
      EXPECT_TRUE(there.contains(link.first) && there.contains(link.second));
    }
  }
}

// Of the loops between poses all of which are as likely as any other, (m/n)² survive.
TEST_F(RandomPosesTest, PosesFirstLosesTheLoopsOfPosesThatAreNotKept) {
  constexpr int kSeeds = 40, kPoses = 80;
  double survived = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const PolicyRun few = keep_poses_first(kPoses, 100'000, seed);
    const std::set<Id> there = kept(few);
    std::set<Pair> expected;
    for (const auto& [a, b] : loops()) {
      if (there.contains(a) && there.contains(b)) expected.emplace(a, b);
    }
    const auto links = few.links();
    EXPECT_EQ(std::set<Pair>(links.begin(), links.end()), expected);
    survived += static_cast<double>(links.size()) / static_cast<double>(loops().size());
  }
  EXPECT_NEAR(survived / kSeeds, (kPoses / 200.0) * (kPoses / 200.0), 0.03);
}

// The other draw keeps whatever poses its loops need.
TEST_F(RandomPosesTest, PosesFirstDrawsPosesWithoutRegardToLoops) {
  std::map<Id, int> ends;
  for (const auto& [a, b] : loops()) ++ends[a], ++ends[b];
  const auto loops_per_pose = [&](const PolicyRun& run) {
    double sum = 0.0;
    for (const Id id : kept(run)) sum += ends[id];
    return sum / 40.0;
  };
  double poses_first = 0.0, loops_first = 0.0;
  for (int seed = 1; seed <= 20; ++seed) {
    poses_first += loops_per_pose(keep_poses_first(40, 25, seed));
    loops_first += loops_per_pose(keep(40, 25, seed));
  }
  EXPECT_NEAR(poses_first / 20.0, 2.0 * static_cast<double>(loops().size()) / 200.0, 0.3);
  EXPECT_GT(loops_first, 1.1 * poses_first);
}

TEST_F(RandomPosesTest, PosesFirstDrawsTheSameForASeed) {
  const PolicyRun one = keep_poses_first(100, 10), same = keep_poses_first(100, 10),
                  other = keep_poses_first(100, 10, 2);
  EXPECT_EQ(one.kept(), same.kept());
  EXPECT_EQ(one.links(), same.links());
  EXPECT_NE(one.kept(), other.kept());
  EXPECT_NE(one.links(), other.links());
}

// The minimum is that of the whole problem, not where the incremental solution happened to be.
TEST_F(RandomPosesTest, IsSolvedUntilItHasConverged) {
  for (const char* draw : {",draw=loops", ",draw=poses"}) {
    const PolicyRun few = keep(100, 30, 1, draw);
    Graph again = few.policy->estimator().graph();
    const double chi2 = few.policy->estimator().chi2();
    registry.make<InitialGuess>("chordal")->compute(again);
    const Summary summary = registry.make<Optimizer>("levenberg_marquardt")->optimize(again);
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_NEAR(chi2, summary.final_chi2, 1e-6 * chi2);
  }
}

TEST_F(RandomPosesTest, TheWayIsInTheChains) {
  const PolicyRun few = keep(40, 10);
  std::vector<Id> ids{0};
  for (const OdometryChain& chain : few.policy->chains()) {
    EXPECT_EQ(chain.from, ids.back());
    for (const ChainStep& step : chain.steps) ids.push_back(step.pose);
  }
  EXPECT_EQ(ids, all_ids(world.graph));
}

TEST_F(RandomPosesTest, FixedPosesAreKeptBesides) {
  world.graph.set_fixed(*world.graph.find(50));
  for (int seed = 1; seed <= 3; ++seed) EXPECT_THAT(keep(5, 0, seed).kept(), Contains(50));
}

TEST_F(RandomPosesTest, RefusesAnUnknownDraw) {
  EXPECT_THROW(registry.make<PosePolicy>("random_poses:draw=both"), Error);
}

TEST_F(RandomPosesTest, CannotFollowARobotLive) {
  const auto policy = registry.make<PosePolicy>("random_poses:poses=10");
  try {
    policy->add_pose(world.graph.variable(0), {});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), testing::HasSubstr("recording"));
  }
}

TEST_F(RandomPosesTest, APoseWithoutAMotionIsRefused) {
  const auto policy = registry.make<PosePolicy>("random_poses:poses=10,loops=0");
  policy->expect(world.graph, pose_chain(world.graph));
  policy->add_pose(world.graph.variable(0), {});
  policy->end_pose();
  EXPECT_THROW(policy->add_pose(world.graph.variable(1), {}), Error);
  const Factor elsewhere = world.graph.factor(1);
  EXPECT_THROW(policy->add_pose(world.graph.variable(1), {&elsewhere, 1}), Error);
  const Factor moved = world.graph.factor(0);
  policy->add_pose(world.graph.variable(1), {&moved, 1});
  policy->end_pose();
  policy->finish();
  EXPECT_THAT(policy->chains(), SizeIs(1));
}

}  // namespace
}  // namespace cairn::compact
