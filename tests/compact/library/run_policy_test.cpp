// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;
using Pair = std::pair<Id, Id>;

/// Writes down what it is told, and asks for all pairs two and four poses apart.
class Scribe final : public PosePolicy {
 public:
  std::vector<std::string> log;
  std::vector<Variable> poses;
  std::vector<std::vector<Factor>> odometry;
  std::vector<std::pair<Pair, std::vector<Factor>>> offers;

  void expect(const Graph& recording, std::span<const Arrival> way) override {
    log.push_back("expect " + std::to_string(way.size()) + " of " +
                  std::to_string(recording.variable_count()));
  }
  void add_pose(const Variable& pose, std::span<const Factor> moved) override {
    log.push_back("add " + std::to_string(pose.id));
    poses.push_back(pose);
    odometry.emplace_back(moved.begin(), moved.end());
    wanted_.clear();
    for (const Id back : {4, 2}) {
      if (pose.id >= back) wanted_.push_back(pose.id - back);
    }
  }
  std::optional<MatchProposal> next_match() override {
    if (wanted_.empty()) return std::nullopt;
    return MatchProposal{wanted_.back(), poses.back().id, 0.0, {}};
  }
  LinkReport offer(Id other, std::span<const Factor> measured) override {
    log.push_back("offer " + std::to_string(other));
    offers.push_back({{other, poses.back().id}, {measured.begin(), measured.end()}});
    if (!forgets) std::erase(wanted_, other);
    return {};
  }
  PoseReport end_pose() override {
    log.emplace_back("end");
    PoseReport report;
    report.id = poses.back().id;
    return report;
  }
  bool finish() override {
    log.emplace_back("finish");
    return converges;
  }
  bool converges = true;
  bool forgets = false;  ///< that it was answered
  Estimator& estimator() override { throw std::logic_error("not asked for"); }
  std::vector<Id> kept() const override { return {}; }
  int factor_count() const override { return 0; }
  std::vector<double> newest_state() const override { return {}; }
  const std::vector<OdometryChain>& chains() const override { return chains_; }

 private:
  std::vector<Id> wanted_;
  std::vector<OdometryChain> chains_;
};

class RunPolicy : public testing::Test {
 protected:
  Registry registry;
};

TEST_F(RunPolicy, TellsThePolicyOfEveryPoseInTurn) {
  Simulation world = simulate(registry, "ring:poses=5");
  Scribe policy;
  const Factor answer = world.graph.factor(0);
  FunctionRegistration registration([&](Id earlier, Id) {
    return earlier == 0 ? std::vector<Factor>{answer} : std::vector<Factor>();
  });
  std::vector<Id> reported;
  run_policy(world.graph, pose_chain(world.graph), policy, registration,
             [&](const PoseReport& report) {
               reported.push_back(report.id);
               return true;
             });
  EXPECT_THAT(policy.log, ElementsAre("expect 5 of 5", "add 0", "end", "add 1", "end", "add 2",
                                      "offer 0", "end", "add 3", "offer 1", "end", "add 4",
                                      "offer 2", "offer 0", "end", "finish"));
  EXPECT_THAT(reported, ElementsAre(0, 1, 2, 3, 4));
  for (const auto& [pair, measured] : policy.offers)
    EXPECT_THAT(measured, SizeIs(pair.first == 0 ? 1 : 0));
}

TEST_F(RunPolicy, APolicyThatProposesAPairAgainIsWrong) {
  const Simulation world = simulate(registry, "ring:poses=5");
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  Scribe policy;
  policy.forgets = true;
  try {
    run_policy(world.graph, pose_chain(world.graph), policy, none);
    ADD_FAILURE() << "it ended";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::plugin);
    EXPECT_THAT(error.what(), testing::HasSubstr("proposes poses 0 and 2 again"));
  }
}

TEST_F(RunPolicy, SaysWhetherThePolicyHasConverged) {
  const Simulation world = simulate(registry, "ring:poses=5");
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  for (const bool converges : {true, false}) {
    Scribe policy;
    policy.converges = converges;
    EXPECT_EQ(run_policy(world.graph, pose_chain(world.graph), policy, none), converges);
  }
}

TEST_F(RunPolicy, LeavesItToOdometryWherePosesAreButForTheFirstAndFixedOnes) {
  Simulation world = simulate(registry, "ring:poses=6");
  world.graph.set_fixed(3);
  Scribe policy;
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  run_policy(world.graph, pose_chain(world.graph), policy, none);
  for (int k = 0; k < 6; ++k) {
    const auto state = world.graph.state(k);
    const bool known = k == 0 || k == 3;
    EXPECT_EQ(policy.poses[k].state,
              known ? std::vector<double>(state.begin(), state.end()) : std::vector<double>());
    EXPECT_EQ(policy.poses[k].fixed, k == 3);
    ASSERT_THAT(policy.odometry[k], SizeIs(k == 0 ? 0 : 1));
    if (k > 0) {
      EXPECT_THAT(policy.odometry[k].front().variables, ElementsAre(k - 1, k));
    }
  }
}

TEST_F(RunPolicy, HandsOverAllOdometryOfAPose) {
  Simulation world = simulate(registry, "ring:poses=4");
  const Factor twice = world.graph.factor(1);
  world.graph.add_factor(twice.type, std::array{2, 1}, twice.measurement, twice.information);
  Scribe policy;
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  run_policy(world.graph, pose_chain(world.graph), policy, none);
  EXPECT_THAT(policy.odometry[1], SizeIs(1));
  ASSERT_THAT(policy.odometry[2], SizeIs(2));
  EXPECT_THAT(policy.odometry[2][1].variables, ElementsAre(2, 1));
}

TEST_F(RunPolicy, StopsWhenToldAndFinishesAllTheSame) {
  Simulation world = simulate(registry, "ring:poses=9");
  Scribe policy;
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  run_policy(world.graph, pose_chain(world.graph), policy, none,
             [](const PoseReport& report) { return report.id < 3; });
  EXPECT_THAT(policy.poses, SizeIs(4));
  EXPECT_EQ(policy.log.back(), "finish");
}

TEST_F(RunPolicy, OfNothingComesNothing) {
  Scribe policy;
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  run_policy(Graph(), {}, policy, none);
  EXPECT_THAT(policy.log, ElementsAre("expect 0 of 0"));
}

TEST_F(RunPolicy, TheCompactPolicyStopsAnywhere) {
  const Simulation world = simulate(registry, "manhattan:poses=100,streets=4");
  const auto registration = registry.make<Registration>("recorded");
  registration->begin({.recording = &world.graph});
  for (const int poses : {1, 2, 17, 60}) {
    const auto policy = registry.make<PosePolicy>("compact_pose:range=5,angle=3.15,reuse=true");
    run_policy(world.graph, pose_chain(world.graph), *policy, *registration,
               [&](const PoseReport& report) { return report.id < poses - 1; });
    const Graph way = recovered_trajectory(*policy, Recovery::distribute);
    EXPECT_EQ(way.variable_count(), poses);
    EXPECT_TRUE(policy->estimator().has(poses - 1));
  }
}

// Recovery ----------------------------------------------------------------------------------------

TEST_F(RunPolicy, TheRecoveredWayHasEveryPoseOnceAndTheKeptOnesWhereTheyAre) {
  const Simulation world = simulate(registry, "manhattan:poses=200,streets=5");
  const PolicyRun few =
      run(registry, world, "compact_pose:range=5,angle=3.15,pose_gain=3,reuse=true", "recorded");
  const std::vector<Id> ids = all_ids(world.graph);
  EXPECT_LT(few.kept().size(), 150U);
  const Graph compact = few.policy->estimator().graph();
  for (const Recovery how : {Recovery::uniform, Recovery::interpolate, Recovery::distribute}) {
    const Graph way = recovered_trajectory(*few.policy, how);
    EXPECT_EQ(way.variable_count(), static_cast<int>(ids.size()));
    EXPECT_EQ(way.factor_count(), 0);
    for (const Id id : ids) EXPECT_TRUE(way.find(id).has_value()) << id;
    for (int v = 0; v < compact.variable_count(); ++v) {
      const auto kept = compact.state(v), back = way.state(*way.find(compact.id(v)));
      EXPECT_TRUE(std::ranges::equal(kept, back)) << compact.id(v);
    }
  }
}

TEST_F(RunPolicy, WithoutNoiseTheRecoveredWayIsTheTruth) {
  struct Case {
    std::string generator;
    std::vector<Recovery> exact;
  };
  // Along a circle and at equal steps the geodesic is the way.
  const std::vector<Recovery> measured{Recovery::distribute};
  const std::vector<Recovery> all{Recovery::uniform, Recovery::interpolate, Recovery::distribute};
  for (const Case& example : {Case{"manhattan:poses=150,streets=4,noise=0", measured},
                              Case{"sphere:turns=5,poses_per_turn=14,noise=0", measured},
                              Case{"ring:poses=150,laps=2.2,noise=0", all}}) {
    const Simulation world = simulate(registry, example.generator);
    const PolicyRun few =
        run(registry, world, "compact_pose:reuse=false,range=40,angle=3.15,loop_gain=3,pose_gain=5",
            "recorded:carry=0");
    EXPECT_LT(few.policy->chains().size(), few.reports.size() / 2);
    const VariableType& type = world.truth.type(0);
    for (const Recovery how : example.exact) {
      const Graph way = recovered_trajectory(*few.policy, how);
      ASSERT_EQ(way.variable_count(), world.truth.variable_count());
      double most = 0.0;
      for (int v = 0; v < way.variable_count(); ++v) {
        Eigen::VectorXd off(type.tangent_size());
        type.local(1, way.state(v).data(), world.truth.state(*world.truth.find(way.id(v))).data(),
                   off.data());
        most = std::max(most, off.norm());
      }
      EXPECT_LT(most, 1e-6) << example.generator << ", recovery " << static_cast<int>(how);
    }
  }
}

TEST_F(RunPolicy, AnEmptyPolicyHasAnEmptyWay) {
  for (const char* name : {"compact_pose", "random_poses"}) {
    const auto policy = registry.make<PosePolicy>(name);
    EXPECT_EQ(recovered_trajectory(*policy, Recovery::distribute).variable_count(), 0);
    EXPECT_THAT(policy->chains(), IsEmpty());
    EXPECT_THROW(policy->newest_state(), Error);
    policy->finish();
    EXPECT_EQ(policy->estimator().variable_count(), 0);
  }
}

TEST(PoseReports, VerdictsHaveNames) {
  EXPECT_EQ(to_string(LinkVerdict::linked), "linked");
  EXPECT_EQ(to_string(LinkVerdict::unmatched), "unmatched");
  EXPECT_EQ(to_string(LinkVerdict::uninformative), "uninformative");
  EXPECT_EQ(to_string(LinkVerdict::inconsistent), "inconsistent");
  EXPECT_EQ(to_string(LinkVerdict::waiting), "waiting");
  EXPECT_EQ(to_string(LinkVerdict::nonlinear), "nonlinear");
}

TEST(PoseReports, SecondsAddUpPartByPart) {
  PolicySeconds sum{1.0, 2.0, 3.0, 4.0};
  sum += {0.5, 0.25, 0.125, 0.0625};
  EXPECT_EQ(sum.total, 1.5);
  EXPECT_EQ(sum.estimate, 2.25);
  EXPECT_EQ(sum.covariances, 3.125);
  EXPECT_EQ(sum.search, 4.0625);
}

}  // namespace
}  // namespace cairn::test
