// SPDX-License-Identifier: BSD-3-Clause
// A fixed number of poses: others leave, and factors between their neighbours take their place.
#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/solve/optimizer.hpp"
#include "compact/compact_pose/robot.hpp"
#include "compact/support/policy_runs.hpp"
#include "support/components.hpp"

namespace cairn::compact {
namespace {

using test::PolicyRun;
using testing::HasSubstr;
using testing::Le;

const std::string kTown = "manhattan:streets=4,block=10,loop_density=0,rotation_sigma=0.005,poses=";
const std::string kSensor = "simulated:range=6";
const std::string kPolicy = "compact_pose:range=6,angle=3.15";

/// Hears what becomes of each pose.
class Listening final : public Registration {
 public:
  explicit Listening(Registration& inner) : inner_(inner) {}
  void begin(const RegistrationData&) override {}
  std::vector<Factor> match(Id earlier, Id later) override {
    EXPECT_TRUE(kept.contains(earlier)) << earlier;
    return inner_.match(earlier, later);
  }
  void pose_ended(Id pose, bool is_kept) override {
    if (is_kept) {
      kept.insert(pose);
    } else {
      left += kept.erase(pose);
    }
  }
  std::set<Id> kept;
  std::size_t left = 0;

 private:
  Registration& inner_;
};

class Keep : public testing::Test {
 protected:
  void SetUp() override { CAIRN_NEEDS("node_selection", "nearest"); }

  /// Calls `each` after every pose.
  std::unique_ptr<PosePolicy> drive(const std::string& world, const std::string& options,
                                    const std::function<void(PosePolicy&)>& each) {
    simulation_ = test::simulate(registry, world, 3);
    auto policy = registry.make<PosePolicy>(kPolicy + options);
    const auto sensor = registry.make<Registration>(kSensor);
    sensor->begin({.recording = &simulation_.graph, .truth = &simulation_.truth});
    Listening listening(*sensor);
    const std::vector<Arrival> poses = pose_chain(simulation_.graph);
    run_policy(simulation_.graph, poses, *policy, listening, [&](const PoseReport&) {
      const std::vector<Id> kept = policy->kept();
      EXPECT_EQ(std::set<Id>(kept.begin(), kept.end()), listening.kept);
      each(*policy);
      return true;
    });
    left_ = listening.left;
    return policy;
  }
  TrajectoryError error_of(const Graph& estimate) const {
    return compare(trajectory(estimate), trajectory(simulation_.truth));
  }

  Registry registry;
  Simulation simulation_;
  std::size_t left_ = 0;
};

TEST_F(Keep, NeverMoreThanThatAreKept) {
  constexpr std::size_t kMost = 25;
  const auto policy = drive(kTown + "1200", ",keep=25", [&](PosePolicy& now) {
    EXPECT_THAT(now.kept().size(), Le(kMost));
    EXPECT_EQ(static_cast<std::size_t>(now.estimator().variable_count()), now.kept().size());
    EXPECT_EQ(now.estimator().factor_count(), now.factor_count());
  });
  EXPECT_GT(left_, 20U);
  EXPECT_EQ(policy->kept().size(), kMost);
  EXPECT_EQ(policy->kept().front(), 0);
  EXPECT_TRUE(std::ranges::is_sorted(policy->kept()));
}

/// The robot drives for as long as it likes: links are added where they tell something, and the
/// poses that leave take theirs with them.
TEST_F(Keep, FactorsAreBoundedHoweverLongTheRobotDrives) {
  std::vector<int> factors;
  drive(kTown + "8000", ",keep=30",
        [&](PosePolicy& now) { factors.push_back(now.factor_count()); });
  const auto most = [&](std::size_t from, std::size_t to) {
    return *std::max_element(factors.begin() + static_cast<std::ptrdiff_t>(from),
                             factors.begin() + static_cast<std::ptrdiff_t>(to));
  };
  EXPECT_LE(most(2000, 8000), 3 * 30);
  EXPECT_LE(most(5000, 8000), most(2000, 5000) + 12);
}

TEST_F(Keep, WithRoomForAllNothingIsDifferent) {
  std::optional<Graph> graphs[2];
  std::vector<std::vector<double>> states[2];
  for (int with : {0, 1}) {
    const auto policy = drive(kTown + "500", with ? ",keep=100000" : "",
                              [&](PosePolicy& now) { states[with].push_back(now.newest_state()); });
    graphs[with] = policy->estimator().graph();
    EXPECT_EQ(left_, 0U);
  }
  EXPECT_EQ(states[0], states[1]);
  ASSERT_EQ(graphs[0]->factor_count(), graphs[1]->factor_count());
  ASSERT_EQ(graphs[0]->variable_count(), graphs[1]->variable_count());
  for (int v = 0; v < graphs[0]->variable_count(); ++v)
    EXPECT_TRUE(std::ranges::equal(graphs[0]->state(v), graphs[1]->state(v)));
  for (int f = 0; f < graphs[0]->factor_count(); ++f) {
    EXPECT_TRUE(std::ranges::equal(graphs[0]->measurement(f), graphs[1]->measurement(f)));
    EXPECT_TRUE(std::ranges::equal(graphs[0]->information(f), graphs[1]->information(f)));
  }
}

/// The oracle is the minimum of all poses with odometry and matches of a sample of all pairs, which
/// are not those that the robot asked for.
TEST_F(Keep, TheMapIsNearABatchSolutionOfAllPoses) {
  const auto policy = drive(kTown + "1500", ",keep=30", [](PosePolicy&) {});
  const auto sensor = registry.make<Registration>(kSensor);
  sensor->begin({.recording = &simulation_.graph, .truth = &simulation_.truth});
  Graph full = simulation_.graph.clone();
  for (int later = 0; later < full.variable_count(); later += 3) {
    for (int earlier = 0; earlier + 20 < later; earlier += 7) {
      for (const Factor& link : sensor->match(full.id(earlier), full.id(later))) {
        full.add_factor(link.type,
                        std::array{*full.find(link.variables[0]), *full.find(link.variables[1])},
                        link.measurement, link.information);
      }
    }
  }
  registry.make<Optimizer>("levenberg_marquardt")->optimize(full);
  const double batch = error_of(full).ate_translation,
               odometry = error_of(simulation_.graph).ate_translation,
               map = error_of(policy->estimator().graph()).ate_translation,
               all = error_of(recovered_trajectory(*policy, Recovery::likely)).ate_translation;
  EXPECT_LT(map, 3.0 * batch);
  EXPECT_LT(all, 3.0 * batch);
  EXPECT_LT(batch, 0.05 * odometry);
}

TEST_F(Keep, EveryPoseComesBackOnceWhereItWas) {
  const auto policy = drive(
      "manhattan:streets=4,block=10,loop_density=0,translation_sigma=1e-6,"
      "rotation_sigma=1e-6,poses=900",
      ",keep=12,sensor=0.00001 0.00001", [](PosePolicy&) {});
  EXPECT_GT(left_, 10U);
  for (const Recovery how : {Recovery::distribute, Recovery::likely}) {
    const Graph way = recovered_trajectory(*policy, how);
    EXPECT_EQ(way.variable_count(), simulation_.graph.variable_count());
    EXPECT_LT(error_of(way).ate_translation, 0.01);
  }
}

TEST_F(Keep, APoseThatHasLeftIsNotMatched) {
  std::set<Id> gone;
  const auto policy = drive(kTown + "600", ",keep=20", [&](PosePolicy& now) {
    for (const Id id : now.removed()) gone.insert(id);
  });
  ASSERT_FALSE(gone.empty());
  const Id newest = policy->kept().back();
  const Factor step = simulation_.graph.factor(0);
  Factor odometry = step;
  odometry.variables = {newest, newest + 1};
  policy->add_pose({.type = simulation_.graph.variable(0).type, .id = newest + 1, .state = {}},
                   {&odometry, 1});
  Factor link = step;
  link.variables = {*gone.begin(), newest + 1};
  EXPECT_THAT(message_of(
                  [&] {
                    policy->offer(*gone.begin(), {&link, 1});
                  },
                  ErrorCode::input),
              HasSubstr("is not in the compact graph"));
}

TEST_F(Keep, AMapThatIsContinuedHasThatSizeToo) {
  const auto first = drive(kTown + "400", ",keep=40", [](PosePolicy&) {});
  const Graph map = first->estimator().graph();
  ASSERT_EQ(map.variable_count(), 40);
  // The same streets again, with other ids.
  const Simulation again = test::simulate(registry, kTown + "800", 8);
  const auto moved = [&](const Graph& graph) {
    Graph result;
    for (int v = 0; v < graph.variable_count(); ++v) {
      Variable variable = graph.variable(v);
      result.add_variable(variable.type, variable.id + 10000, variable.state);
    }
    for (int f = 0; f < graph.factor_count(); ++f) {
      const Factor factor = graph.factor(f);
      result.add_factor(factor.type, graph.factor_variables(f), factor.measurement,
                        factor.information);
    }
    return result;
  };
  const Graph recording = moved(again.graph);
  Graph truth = moved(again.truth);
  for (int v = 0; v < simulation_.truth.variable_count(); ++v) {
    truth.add_variable(simulation_.truth.variable(v).type, simulation_.truth.id(v),
                       simulation_.truth.state(v));
  }
  const auto sensor = registry.make<Registration>(kSensor);
  sensor->begin({.recording = &recording, .truth = &truth});
  const auto policy = registry.make<PosePolicy>(kPolicy + ",keep=45");
  policy->load(map);
  const std::vector<Arrival> poses = pose_chain(recording);
  run_policy(recording, poses, *policy, *sensor, [&](const PoseReport&) {
    EXPECT_LE(policy->kept().size(), 45U);
    return true;
  });
  EXPECT_TRUE(policy->unlocated().empty());
  EXPECT_LT(compare(trajectory(policy->estimator().graph()), trajectory(truth)).ate_translation,
            1.0);
}

TEST_F(Keep, PosesThatAreFixedStayAndANoteSaysSo) {
  const Simulation world = test::simulate(registry, kTown + "12");
  const auto policy = registry.make<PosePolicy>(kPolicy + ",keep=3,reuse=false");
  std::vector<std::string> notes;
  for (const Arrival& arrival : pose_chain(world.graph)) {
    GraphUpdate update = arrival_update(world.graph, arrival);
    Variable pose = update.variables.front();
    pose.fixed = true;
    pose.state.assign(world.truth.state(arrival.pose()).begin(),
                      world.truth.state(arrival.pose()).end());
    policy->add_pose(pose, update.factors);
    const PoseReport report = policy->end_pose();
    notes.insert(notes.end(), report.notes.begin(), report.notes.end());
  }
  EXPECT_EQ(policy->kept().size(), 12U);
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("more poses stay than are to be kept")));
}

TEST_F(Keep, RefusesWhatCannotBe) {
  const auto refusal = [&](const std::string& options, ErrorCode code) {
    return message_of([&] { registry.make<PosePolicy>("compact_pose:" + options); }, code);
  };
  EXPECT_THAT(refusal("keep=1", ErrorCode::usage), HasSubstr("expected 2 or more, or 0"));
  EXPECT_THAT(refusal("keep=-3", ErrorCode::usage), HasSubstr("keep"));
  EXPECT_THAT(refusal("keep=20,strategy=apal", ErrorCode::usage),
              HasSubstr("strategy apal keeps all poses"));
  EXPECT_THAT(refusal("keep=20,select=nearby", ErrorCode::plugin), HasSubstr("nearby"));
  EXPECT_THAT(refusal("keep=20,sparsifier=dense", ErrorCode::plugin), HasSubstr("dense"));
  EXPECT_NO_THROW(registry.make<PosePolicy>("compact_pose:keep=2"));
}

}  // namespace
}  // namespace cairn::compact
